// Releases for the board: the images of ./run firmware under other versions, counters, products and keys.
#pragma once

#include <string>
#include <vector>

#include "firmware/backplane/shared_memory.h"
#include "host_sdk/device/updater.h"
#include "host_sdk/firmware_files/signing.h"
#include "tests/emulator/rig.h"

namespace scatter::emulator {

inline const std::vector<protocol::PublicKey> kTrusted{firmware_files::kTestPublicKey};

[[nodiscard]] inline firmware_files::SecretKey test_key() {
  auto key = firmware_files::load_secret_key("firmware/keys/test.key");
  REQUIRE(key.has_value());
  return *key;
}

[[nodiscard]] inline firmware_files::Package built_package() {
  const auto files = firmware_files();
  REQUIRE(files.has_value());
  auto package = firmware_files::Package::load(files->firmware);
  REQUIRE(package.has_value());
  return std::move(*package);
}

/// The built images with bytes of this release's own behind them, so that no two releases are alike.
[[nodiscard]] inline firmware_files::Release release(const std::string& version, std::uint32_t counter) {
  const firmware_files::Package built = built_package();
  firmware_files::Release release;
  release.product = built.product();
  release.version = version;
  release.security_counter = counter;
  for (std::size_t slot = 0; slot < firmware_files::kImages; ++slot) {
    auto& linking = release.linkings[slot];
    linking.name = version;
    linking.address = built.image(slot).header.load_address;
    linking.body = built.image(slot).body;
    for (std::size_t k = 0; k < 4096; ++k) {
      linking.body.push_back(static_cast<std::byte>(version[k % version.size()]));
    }
  }
  return release;
}

[[nodiscard]] inline firmware_files::Package signed_release(const firmware_files::Release& release,
                                                            const firmware_files::SecretKey& key) {
  auto package = firmware_files::sign(release, key);
  if (!package) {
    FAIL(package.error().what);
  }
  return std::move(*package);
}
[[nodiscard]] inline firmware_files::Package package_of(const std::string& version, std::uint32_t counter) {
  return signed_release(release(version, counter), test_key());
}

[[nodiscard]] inline device::OpenDevice opener(const Emulated& emulated) {
  return [&emulated](const device::Wait& wait) { return emulated.try_open(wait); };
}

[[nodiscard]] inline device::UpdateOptions update_options() {
  device::UpdateOptions options;
  options.trusted = kTrusted;
  return options;
}

}  // namespace scatter::emulator
