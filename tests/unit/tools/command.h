// Runs the program as a user does: arguments, exit status, both outputs.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

/// A folder that goes away with the object.
class Scratch {
 public:
  Scratch();
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }

 private:
  std::filesystem::path folder_;
};

struct Finished {
  int status = -1;  ///< Exit status; 128 + signal when killed; -1 when it hung and had to be killed.
  std::string out;
  std::string err;
};

/// The program while it runs. Killed by the destructor when it still does.
class Command {
 public:
  /// Standard output goes to `out` when given, else into the answer; standard input is empty.
  explicit Command(const std::vector<std::string>& arguments, const std::filesystem::path& out = {});
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  void signal(int number) const;
  /// What standard output holds by now.
  [[nodiscard]] std::string output() const;
  /// Waits; after `limit` the program is killed.
  [[nodiscard]] Finished wait(std::chrono::seconds limit = std::chrono::seconds(60));

 private:
  Scratch scratch_;
  std::filesystem::path out_;
  int pid_ = -1;
};

[[nodiscard]] Finished scatter(const std::vector<std::string>& arguments);

[[nodiscard]] std::string contents(const std::filesystem::path& file);
