#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "firmware/keys/test_key.h"
#include "host_sdk/firmware_files/keys.h"
#include "tests/unit/firmware_files/made_release.h"

namespace scatter::firmware_files::test {
namespace {

namespace fs = std::filesystem;

class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "scatter-keys-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

std::string contents(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

const std::string kGoodPublic =
    "openscatter-public-key-1\nd75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a\n";
const std::string kGoodSecret =
    "openscatter-secret-key-1\n9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60\n";

}  // namespace

// PROVES: RFC 8032, 7.1, TEST 1.
TEST_CASE("A secret key's public key is that of RFC 8032") {
  CHECK(SecretKey(kRfcSeed).public_key() == kRfcPublic);
  CHECK(parse_secret_key(kGoodSecret, "k")->seed() == kRfcSeed);
  CHECK(*parse_public_key(kGoodPublic, "k") == kRfcPublic);
}

TEST_CASE("The repository's test key is the one that tools and firmware know as such") {
  const auto secret = load_secret_key("firmware/keys/test.key");
  const auto open = load_public_key("firmware/keys/test.pub");
  REQUIRE(secret);
  REQUIRE(open);
  CHECK(*open == kTestPublicKey);
  CHECK(secret->public_key() == kTestPublicKey);
  CHECK(firmware::kTestKey.key == kTestPublicKey);
  CHECK(key_id(kTestPublicKey) == firmware::kTestKey.id);
  CHECK(text(firmware::kTestKey.id) == "c4075324a1f20817");
}

TEST_CASE("New keys are a pair, differ each time, and only their owner can read the secret") {
  const Folder folder;
  const auto first = generate_keys(folder / "a");
  const auto second = generate_keys(folder / "b");
  REQUIRE(first);
  REQUIRE(second);
  CHECK(first->key != second->key);
  CHECK(load_secret_key(first->secret)->public_key() == first->key);
  CHECK(*load_public_key(first->open) == first->key);
  struct stat status{};
  REQUIRE(stat(first->secret.c_str(), &status) == 0);
  CHECK((status.st_mode & 0777U) == 0600);
}

TEST_CASE("A key is never overwritten, neither half, and nothing is left behind") {
  const Folder folder;
  const std::string half = GENERATE(".key", ".pub");
  std::ofstream(folder / (half == ".key" ? "a.key" : "a.pub")) << "mine";
  const auto made = generate_keys(folder / "a");
  REQUIRE_FALSE(made);
  CHECK(made.error().code == ErrorCode::kFailedPrecondition);
  CHECK(contents(folder / (half == ".key" ? "a.key" : "a.pub")) == "mine");
  CHECK_FALSE(fs::exists(folder / (half == ".key" ? "a.pub" : "a.key")));
}

TEST_CASE("A key whose folder does not exist is not made") {
  const auto made = generate_keys("/nonexistent/a");
  REQUIRE_FALSE(made);
  CHECK(made.error().code == ErrorCode::kNotFound);
}

TEST_CASE("Key files may have other line ends and capitals, and lack the last line end") {
  std::string crlf;
  for (const char c : kGoodPublic) {
    if (c == '\n') {
      crlf += '\r';
    }
    crlf += c;
  }
  CHECK(*parse_public_key(crlf, "k") == kRfcPublic);
  std::string capitals = kGoodPublic;
  std::transform(capitals.begin() + 25, capitals.end(), capitals.begin() + 25, ::toupper);
  CHECK(*parse_public_key(capitals, "k") == kRfcPublic);
  CHECK(*parse_public_key(kGoodPublic.substr(0, kGoodPublic.size() - 1), "k") == kRfcPublic);
}

TEST_CASE("A damaged key file is refused with its line, what is there and what should be") {
  struct Case {
    std::string contents;
    std::string says;
  };
  const auto [text, says] = GENERATE(values<Case>({
      {"", "line 1 is not \"openscatter-public-key-1\""},
      {"ssh-ed25519 AAAA\n", "line 1"},
      {"openscatter-public-key-1\n", "line 2 has 0 characters"},
      {"openscatter-public-key-1\nd75a98\n", "line 2 has 6 characters"},
      {"openscatter-public-key-1\n" + std::string(63, '0') + "g\n", "column 64"},
      {"openscatter-public-key-1\n" + std::string(64, '0') + "\n\n", "something follows line 2"},
  }));
  CAPTURE(text);
  const auto key = parse_public_key(text, "maker.pub");
  REQUIRE_FALSE(key);
  CHECK_THAT(key.error().what, Catch::Contains("maker.pub") && Catch::Contains(says));
  CHECK_FALSE(key.error().remedy.empty());
}

TEST_CASE("A secret key where a public one is wanted is refused without showing it, and the reverse") {
  const auto open = parse_public_key(kGoodSecret, "k");
  REQUIRE_FALSE(open);
  CHECK_THAT(open.error().remedy, Catch::Contains(".pub"));
  CHECK_THAT(open.error().what, !Catch::Contains("9d61"));
  const auto secret = parse_secret_key(kGoodPublic, "k");
  REQUIRE_FALSE(secret);
  CHECK_THAT(secret.error().remedy, Catch::Contains(".key"));
}

TEST_CASE("A key file that is missing, a folder or far too long is refused") {
  const Folder folder;
  CHECK(load_public_key(folder / "none").error().code == ErrorCode::kNotFound);
  fs::create_directory(folder / "folder");
  CHECK(load_public_key(folder / "folder").error().code == ErrorCode::kInvalidArgument);
  std::ofstream(folder / "long") << std::string(100'000, 'x');
  CHECK(load_public_key(folder / "long").error().code == ErrorCode::kResourceExhausted);
}

}  // namespace scatter::firmware_files::test
