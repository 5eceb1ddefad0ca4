// Signing a release, and finding out who signed one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/firmware_files/keys.h"
#include "host_sdk/firmware_files/package.h"

namespace scatter::firmware_files {

/// What is to be signed.
struct Release {
  struct Linking {
    std::string name;             ///< For messages: the file that it came from.
    std::uint32_t address = 0;    ///< Where the body runs.
    std::vector<std::byte> body;  ///< A vector table first.
  };
  std::string product;  ///< As in the descriptor: 1 to 32 characters.
  std::string version;  ///< 1 to 32 characters.
  std::uint32_t security_counter = 0;
  std::array<Linking, kImages> linkings;  ///< For slot 0 and slot 1.
};

/// Signs both linkings.
/// Errors  kInvalidArgument: a text is empty, too long or not printable; a body is empty or too long; a
/// body's
///         reset vector points outside it, so that it is linked for another address.
[[nodiscard]] Result<Package> sign(const Release& release, const SecretKey& key);

/// The one of the trusted keys that signed the package.
/// Errors  kPermissionDenied: signed with a key that is not among them, or a signature that is wrong.
[[nodiscard]] Result<protocol::PublicKey> verify(const Package& package,
                                                 std::span<const protocol::PublicKey> trusted);

}  // namespace scatter::firmware_files
