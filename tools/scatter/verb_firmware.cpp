// scatter firmware keygen|sign|verify: makes and checks signed firmware files.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <array>
#include <memory>

#include "host_sdk/firmware_files/dfu_suffix.h"
#include "host_sdk/firmware_files/file_bytes.h"
#include "host_sdk/firmware_files/keys.h"
#include "host_sdk/firmware_files/package.h"
#include "host_sdk/firmware_files/signing.h"
#include "tools/scatter/files.h"
#include "tools/scatter/firmware_description.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/trusted_keys.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {
namespace {

using firmware_files::Package;

struct SignOptions {
  std::string key;
  std::string product;
  std::string version;
  std::uint32_t counter = 0;
  std::array<std::string, firmware_files::kImages> slots;
  std::array<std::uint32_t, firmware_files::kImages> addresses{};
  std::string output;
  std::string dfu;
};

struct Options {
  std::string keys_name;
  SignOptions sign;
  std::string image;
  std::vector<std::string> trusted;
};

Result<Answer> keygen(const Options& options) {
  const auto made = firmware_files::generate_keys(options.keys_name);
  if (!made) {
    return std::unexpected(made.error());
  }
  const std::string id = firmware_files::text(firmware_files::key_id(made->key));
  Answer answer;
  answer.json = {{"key", id}, {"secret_key", made->secret.string()}, {"public_key", made->open.string()}};
  answer.text = fmt::format("key {}\n{}: secret; keep it away from others, and keep a copy\n{}: public\n", id,
                            made->secret.string(), made->open.string());
  return answer;
}

std::string_view text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TextRows rows_of(const Package& package) {
  TextRows rows = {{"firmware", fmt::format("{} {}, security counter {}", package.product(),
                                            package.version(), package.security_counter())}};
  for (std::size_t slot = 0; slot < firmware_files::kImages; ++slot) {
    const auto& header = package.image(slot).header;
    rows.push_back({fmt::format("slot {}", slot),
                    fmt::format("{} bytes for address 0x{:08x}", header.body_bytes, header.load_address)});
  }
  return rows;
}

Result<Answer> sign(const Options& all) {
  const SignOptions& options = all.sign;
  const auto key = firmware_files::load_secret_key(options.key);
  if (!key) {
    return std::unexpected(key.error());
  }
  firmware_files::Release release;
  release.product = options.product;
  release.version = options.version;
  release.security_counter = options.counter;
  for (std::size_t slot = 0; slot < firmware_files::kImages; ++slot) {
    auto body = firmware_files::read_file(options.slots[slot], firmware_files::kMaxBodyBytes);
    if (!body) {
      return std::unexpected(body.error());
    }
    release.linkings[slot] = {
        .name = options.slots[slot], .address = options.addresses[slot], .body = std::move(*body)};
  }
  const auto package = firmware_files::sign(release, *key);
  if (!package) {
    return std::unexpected(package.error());
  }
  auto bytes = package->bytes();
  if (const auto wrote = write_file(options.output, text_of(bytes)); !wrote) {
    return std::unexpected(wrote.error());
  }
  Answer answer;
  answer.json = to_json(*package);
  auto& files = answer.json["files"] = {options.output};
  auto rows = rows_of(*package);
  rows.push_back({"signed with", key_words(package->key(), package->for_test())});
  rows.push_back({"file", options.output});
  if (!options.dfu.empty()) {
    const auto suffix = firmware_files::dfu_suffix(bytes);
    bytes.insert(bytes.end(), suffix.begin(), suffix.end());
    if (const auto wrote = write_file(options.dfu, text_of(bytes)); !wrote) {
      return std::unexpected(wrote.error());
    }
    files.push_back(options.dfu);
    rows.push_back({"file", options.dfu});
  }
  answer.text = text_table(rows);
  return answer;
}

Result<Answer> verify(const Options& options) {
  const auto keys = trusted_keys(options.trusted);
  if (!keys) {
    return std::unexpected(keys.error());
  }
  const auto package = Package::load(options.image);
  if (!package) {
    return std::unexpected(package.error());
  }
  if (const auto signer = firmware_files::verify(*package, *keys); !signer) {
    Error error = signer.error();
    error.what = fmt::format("{}: {}{}", options.image, error.what,
                             options.trusted.empty() ? "; without --key only the test key is known" : "");
    return std::unexpected(std::move(error));
  }
  Answer answer;
  answer.json = to_json(*package);
  answer.json["verified"] = true;
  auto rows = rows_of(*package);
  rows.push_back({"signed with", key_words(package->key(), package->for_test())});
  answer.text = text_table(rows) + "signatures, hashes and sizes are right\n";
  if (package->for_test()) {
    answer.text += "release instruments refuse the test key\n";
  }
  return answer;
}

}  // namespace

Verb add_firmware(CLI::App& root) {
  auto* app = root.add_subcommand("firmware", "Make keys, and sign and verify firmware files");
  auto options = std::make_shared<Options>();
  app->require_subcommand(1);

  auto* keygen_app = app->add_subcommand("keygen", "Make a new key pair: NAME.key and NAME.pub");
  keygen_app->add_option("-o,--output", options->keys_name, "Name of the key files, without .key")
      ->required();

  auto* sign_app = app->add_subcommand("sign", "Sign the two linkings of a firmware as one .scfw file");
  SignOptions& sign_options = options->sign;
  sign_app->add_option("--key", sign_options.key, "Secret key (.key)")->required();
  sign_app->add_option("--product", sign_options.product, "Product that it is for, as scatter info names it")
      ->required();
  sign_app->add_option("--version", sign_options.version, "Version of the firmware")->required();
  sign_app
      ->add_option("--counter", sign_options.counter,
                   "Security counter: raise it when an older firmware must never come back")
      ->required();
  for (std::size_t slot = 0; slot < firmware_files::kImages; ++slot) {
    sign_app
        ->add_option(fmt::format("--slot{}", slot), sign_options.slots[slot],
                     fmt::format("Binary (.bin) linked for slot {}", slot))
        ->required();
    sign_app
        ->add_option(fmt::format("--address{}", slot), sign_options.addresses[slot],
                     fmt::format("Address that it is linked for, for example 0x{:08x}",
                                 0x60800400U + static_cast<unsigned>(slot) * 0x80000U))
        ->required();
  }
  sign_app->add_option("-o,--output", sign_options.output, "Firmware file (.scfw)")->required();
  sign_app->add_option("--dfu", sign_options.dfu, "The same with a DFU suffix (.dfu), too");

  auto* verify_app = app->add_subcommand("verify", "Check a firmware file and tell who signed it");
  verify_app->add_option("image", options->image, "Firmware file (.scfw or .dfu)")->required();
  add_key_option(*verify_app, options->trusted);

  for (auto* one : {keygen_app, sign_app, verify_app}) {
    one->fallthrough();  // So that --json may stand at the end.
  }
  return {app, [options, keygen_app, sign_app](const Context&) {
            return keygen_app->parsed() ? keygen(*options)
                   : sign_app->parsed() ? sign(*options)
                                        : verify(*options);
          }};
}

}  // namespace scatter::cli
