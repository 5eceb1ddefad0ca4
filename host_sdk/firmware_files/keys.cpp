#include "host_sdk/firmware_files/keys.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sodium.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>

#include "host_sdk/firmware_files/file_bytes.h"

namespace scatter::firmware_files {
namespace {

constexpr std::string_view kSecretLine = "openscatter-secret-key-1";
constexpr std::string_view kPublicLine = "openscatter-public-key-1";
constexpr std::size_t kMaxKeyFileBytes = 4096;

using Words = std::array<std::uint8_t, 32>;

/// One line without its end; `rest` becomes what follows.
std::string_view take_line(std::string_view& rest) {
  const std::size_t end = rest.find('\n');
  std::string_view line = rest.substr(0, end);
  rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
  if (line.ends_with('\r')) {
    line.remove_suffix(1);
  }
  return line;
}

std::optional<unsigned> digit(char c) {
  if (c >= '0' && c <= '9') {
    return static_cast<unsigned>(c - '0');
  }
  const char lower = static_cast<char>(c | 0x20);
  if (lower >= 'a' && lower <= 'f') {
    return static_cast<unsigned>(lower - 'a' + 10);
  }
  return std::nullopt;
}

Result<Words> parse(std::string_view contents, std::string_view file, std::string_view wanted,
                    std::string_view other, std::string_view remedy) {
  const std::string_view first = take_line(contents);
  if (first == other) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: line 1 is \"{}\" when it should be \"{}\"", file, other, wanted),
                std::string(remedy));
  }
  if (first != wanted) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: line 1 is not \"{}\", so this is no such key", file, wanted),
                "name a key file that scatter firmware keygen made");
  }
  const std::string_view digits = take_line(contents);
  Words out{};
  const auto damaged = [&](const std::string& why) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: line 2 {}", file, why),
                "take the key from its backup; make no change to it by hand");
  };
  if (digits.size() != 2 * out.size()) {
    return damaged(fmt::format("has {} characters when it should have 64 hexadecimal digits", digits.size()));
  }
  for (std::size_t k = 0; k < out.size(); ++k) {
    const auto high = digit(digits[2 * k]);
    const auto low = digit(digits[2 * k + 1]);
    if (!high || !low) {
      return damaged(fmt::format("has no hexadecimal digit at column {}", 2 * k + (high ? 2 : 1)));
    }
    out[k] = static_cast<std::uint8_t>(*high << 4U | *low);
  }
  if (!contents.empty()) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: something follows line 2, expected its end", file),
                "keep one key per file");
  }
  return out;
}

std::string key_text(std::string_view line, const Words& words) {
  std::string out(line);
  out += '\n';
  for (const std::uint8_t b : words) {
    out += fmt::format("{:02x}", b);
  }
  out += '\n';
  return out;
}

Result<std::string> load(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kMaxKeyFileBytes);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  return std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size());
}

/// A file that must not be there yet.
Status write_new(const std::filesystem::path& file, const std::string& contents, mode_t mode) {
  const int handle = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (handle < 0) {
    const int number = errno;
    if (number == EEXIST) {
      return fail(ErrorCode::kFailedPrecondition,
                  fmt::format("{} exists, and keys are never overwritten", file.string()),
                  "choose another name, or move the old key away yourself");
    }
    return std::unexpected(file_error("create", file, number));
  }
  const bool whole =
      ::write(handle, contents.data(), contents.size()) == ssize_t(contents.size()) && ::fsync(handle) == 0;
  const int number = errno;
  if (::close(handle) != 0 || !whole) {
    ::unlink(file.c_str());
    return std::unexpected(file_error("write", file, number));
  }
  return {};
}

}  // namespace

SecretKey::~SecretKey() {
  sodium_memzero(seed_.data(), seed_.size());
}

protocol::PublicKey SecretKey::public_key() const {
  protocol::PublicKey open{};
  std::array<std::uint8_t, crypto_sign_SECRETKEYBYTES> both{};
  crypto_sign_seed_keypair(open.data(), both.data(), seed_.data());
  sodium_memzero(both.data(), both.size());
  return open;
}

protocol::KeyId key_id(const protocol::PublicKey& key) {
  protocol::Sha512 hash{};
  crypto_hash_sha512(hash.data(), key.data(), key.size());
  protocol::KeyId id{};
  std::copy_n(hash.begin(), id.size(), id.begin());
  return id;
}

std::string text(const protocol::KeyId& id) {
  std::string out;
  for (const std::uint8_t b : id) {
    out += fmt::format("{:02x}", b);
  }
  return out;
}

Result<SecretKey> parse_secret_key(std::string_view contents, std::string_view file) {
  const auto seed =
      parse(contents, file, kSecretLine, kPublicLine, "sign with the secret key: the file that ends in .key");
  if (!seed) {
    return std::unexpected(seed.error());
  }
  return SecretKey(*seed);
}

Result<protocol::PublicKey> parse_public_key(std::string_view contents, std::string_view file) {
  return parse(contents, file, kPublicLine, kSecretLine,
               "name the public key: the file that ends in .pub; keep the secret one to yourself");
}

Result<SecretKey> load_secret_key(const std::filesystem::path& file) {
  auto contents = load(file);
  if (!contents) {
    return std::unexpected(contents.error());
  }
  auto key = parse_secret_key(*contents, file.string());
  sodium_memzero(contents->data(), contents->size());
  return key;
}

Result<protocol::PublicKey> load_public_key(const std::filesystem::path& file) {
  const auto contents = load(file);
  if (!contents) {
    return std::unexpected(contents.error());
  }
  return parse_public_key(*contents, file.string());
}

Result<KeyFiles> generate_keys(const std::filesystem::path& name) {
  if (sodium_init() < 0) {
    return fail(ErrorCode::kInternal, "libsodium cannot start: the system gives no random numbers",
                "check /dev/urandom");
  }
  KeyFiles files{.secret = name, .open = name, .key = {}};
  files.secret += ".key";
  files.open += ".pub";
  SecretKey::Seed seed{};
  randombytes_buf(seed.data(), seed.size());
  const SecretKey secret(seed);
  files.key = secret.public_key();
  std::string contents = key_text(kSecretLine, seed);
  sodium_memzero(seed.data(), seed.size());
  // The public one first: when it cannot be made, no secret has touched the disk.
  Status wrote = write_new(files.open, key_text(kPublicLine, files.key), 0644);
  if (wrote) {
    wrote = write_new(files.secret, contents, 0600);
    if (!wrote) {
      ::unlink(files.open.c_str());
    }
  }
  sodium_memzero(contents.data(), contents.size());
  if (!wrote) {
    return std::unexpected(wrote.error());
  }
  return files;
}

}  // namespace scatter::firmware_files
