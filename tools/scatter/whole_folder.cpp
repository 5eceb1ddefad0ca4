#include "tools/scatter/whole_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>

#include "tools/scatter/files.h"

namespace scatter::cli {

namespace fs = std::filesystem;

Result<WholeFolder> WholeFolder::make(const fs::path& wanted) {
  // "out/" and "out" are one folder.
  const fs::path folder = wanted.has_filename() ? wanted : wanted.parent_path();
  std::error_code error;
  const bool there = fs::exists(folder, error);
  const fs::path parent = folder.parent_path().empty() ? fs::path(".") : folder.parent_path();
  if (const auto ready = prepare_folder(there ? folder : parent); !ready) {
    return std::unexpected(ready.error());
  }
  // Inside the wanted folder when that is there: its parent may be closed to us, or another disk.
  fs::path place =
      (there ? folder : parent) / fmt::format(".{}.{}.partial", folder.filename().string(), ::getpid());
  if (auto ready = prepare_folder(place); !ready) {
    Error problem = std::move(ready.error());
    // The person knows the folder by its own name.
    if (const auto at = problem.what.find(place.string()); at != std::string::npos) {
      problem.what.replace(at, place.string().size(), folder.string());
    }
    return std::unexpected(std::move(problem));
  }
  return WholeFolder(folder, std::move(place));
}

WholeFolder::WholeFolder(WholeFolder&& other) noexcept
    : wanted_(std::move(other.wanted_)), place_(std::move(other.place_)) {
  other.place_.clear();
}

WholeFolder::~WholeFolder() {
  if (!place_.empty()) {
    std::error_code error;
    fs::remove_all(place_, error);
  }
}

Result<std::vector<std::string>> WholeFolder::publish() {
  const auto failed = [this](const std::error_code& error) {
    return fail(
        ErrorCode::kUnavailable, fmt::format("cannot write into {}: {}", wanted_.string(), error.message()),
        "check that nothing of another kind has the name of a result there, or choose another with -o");
  };
  std::error_code error;
  std::vector<fs::path> files;
  for (fs::recursive_directory_iterator it(place_, error), end; it != end && !error; it.increment(error)) {
    if (it->is_regular_file(error)) {
      files.push_back(fs::relative(it->path(), place_, error));
    }
  }
  if (error) {
    return failed(error);
  }
  std::ranges::sort(files);
  std::vector<std::string> published;
  if (!fs::exists(wanted_, error)) {
    fs::rename(place_, wanted_, error);
    if (error) {
      return failed(error);
    }
    place_.clear();
  }
  for (const fs::path& file : files) {
    const fs::path to = wanted_ / file;
    if (!place_.empty()) {
      fs::create_directories(to.parent_path(), error);
      if (!error) {
        fs::rename(place_ / file, to, error);
      }
      if (error) {
        return failed(error);
      }
    }
    published.push_back(to.string());
  }
  return published;
}

}  // namespace scatter::cli
