// Whose firmware this user trusts.
#pragma once

#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "protocol/image_header.h"

namespace CLI {  // NOLINT(readability-identifier-naming): theirs
class App;
}

namespace scatter::cli {

/// Adds --key to a verb; the files are read by trusted_keys().
void add_key_option(CLI::App& app, std::vector<std::string>& files);

/// The keys in the files; without files the test key, which every developer's device trusts.
/// Errors  of firmware_files::load_public_key.
[[nodiscard]] Result<std::vector<protocol::PublicKey>> trusted_keys(const std::vector<std::string>& files);

}  // namespace scatter::cli
