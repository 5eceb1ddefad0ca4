// A progress bar on standard error, on a terminal only.
#pragma once

#include <string>

namespace scatter::cli {

class Progress {
 public:
  Progress();
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// fraction 0..1; draws at most once per whole percent. One thread.
  void show(double fraction, const std::string& what);
  /// Takes the bar away.
  void clear();

 private:
  bool terminal_ = false;
  bool visible_ = false;
  int percent_ = -1;
  std::string what_;
};

}  // namespace scatter::cli
