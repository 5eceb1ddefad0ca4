// A folder of results that appears whole or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::cli {

/// Files are made in a hidden folder beside the one that is wanted; publish() moves them. Without it the
/// destructor takes everything away, so that an error or a ctrl-C leaves the place as it was. Threads place()
/// and paths may be used from any number of threads; publish() from one.
class WholeFolder {
 public:
  /// Errors    as prepare_folder, of the wanted folder's parent and of the folder itself where it is there.
  [[nodiscard]] static Result<WholeFolder> make(const std::filesystem::path& wanted);
  ~WholeFolder();
  WholeFolder(WholeFolder&& other) noexcept;
  WholeFolder& operator=(WholeFolder&&) = delete;
  WholeFolder(const WholeFolder&) = delete;
  WholeFolder& operator=(const WholeFolder&) = delete;

  /// Where to make files until publish().
  [[nodiscard]] const std::filesystem::path& place() const noexcept { return place_; }
  /// Moves everything into the wanted folder; files there of the same names are replaced, others stay.
  /// Returns   the paths of the files, in order.
  /// Errors    kUnavailable with the system's words.
  [[nodiscard]] Result<std::vector<std::string>> publish();

 private:
  WholeFolder(std::filesystem::path wanted, std::filesystem::path place)
      : wanted_(std::move(wanted)), place_(std::move(place)) {}
  std::filesystem::path wanted_;
  std::filesystem::path place_;
};

}  // namespace scatter::cli
