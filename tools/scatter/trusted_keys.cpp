#include "tools/scatter/trusted_keys.h"

#include <CLI/CLI.hpp>

#include "host_sdk/firmware_files/keys.h"

namespace scatter::cli {

void add_key_option(CLI::App& app, std::vector<std::string>& files) {
  app.add_option(
      "--key", files,
      "Public key (.pub) of the firmware's maker; may be given several times. Without it, only the "
      "test key is known");
}

Result<std::vector<protocol::PublicKey>> trusted_keys(const std::vector<std::string>& files) {
  std::vector<protocol::PublicKey> keys;
  for (const std::string& file : files) {
    const auto key = firmware_files::load_public_key(file);
    if (!key) {
      return std::unexpected(key.error());
    }
    keys.push_back(*key);
  }
  if (keys.empty()) {
    keys.push_back(firmware_files::kTestPublicKey);
  }
  return keys;
}

}  // namespace scatter::cli
