// PROVES: issue 6: `--fix` runs the harmless ones after asking.
#include "tools/scatter/repair.h"

#include <fcntl.h>
#include <pty.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/unit/device_usb_diagnosis/made_up_system.h"

using scatter::cli::repair;
using scatter::cli::Repair;
using scatter::device::usb::Finding;
namespace fs = std::filesystem;

namespace {

Finding problem(const std::string& command, bool harmless = true) {
  Finding finding;
  finding.check = "check";
  finding.verdict = Finding::Verdict::kProblem;
  finding.command = command;
  finding.harmless = harmless;
  return finding;
}

/// Standard input and error for the time of a test.
class Terminal {
 public:
  /// With `typed` a terminal where somebody has typed that; else /dev/null.
  explicit Terminal(const std::string* typed) : input_(dup(0)), error_(dup(2)) {
    int other = -1;
    if (typed != nullptr) {
      REQUIRE(openpty(&master_, &other, nullptr, nullptr, nullptr) == 0);
      REQUIRE(write(master_, typed->data(), typed->size()) == ssize_t(typed->size()));
    } else {
      other = open("/dev/null", O_RDWR);
    }
    dup2(other, 0);
    dup2(other, 2);
    close(other);
  }
  ~Terminal() {
    dup2(input_, 0);
    dup2(error_, 2);
    close(input_);
    close(error_);
    if (master_ >= 0) {
      close(master_);
    }
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

 private:
  int input_;
  int error_;
  int master_ = -1;
};

std::vector<Repair> typing(const std::string& typed, const std::vector<Finding>& findings) {
  const Terminal terminal(&typed);
  return repair(findings, false, {});
}

}  // namespace

TEST_CASE("A command runs when the person says yes, and not when the answer is anything else") {
  const MadeUpSystem folder;
  const std::string file = folder.path() / "made";
  for (const char* answer : {"\n", "n\n", "no\n", "maybe\n", "yy\n"}) {
    const auto declined = typing(answer, {problem("touch " + file)});
    REQUIRE(declined.size() == 1);
    CHECK(declined[0].outcome == Repair::Outcome::kDeclined);
    CHECK_FALSE(fs::exists(file));
  }
  const auto done = typing("y\n", {problem("touch " + file)});
  REQUIRE(done.size() == 1);
  CHECK(done[0].outcome == Repair::Outcome::kDone);
  CHECK(fs::exists(file));
}

TEST_CASE("With nobody at the terminal nothing runs, unless it was agreed to beforehand") {
  const MadeUpSystem folder;
  const std::string file = folder.path() / "made";
  const Terminal nobody(nullptr);
  const auto told = repair({problem("touch " + file)}, false, {});
  REQUIRE(told.size() == 1);
  CHECK(told[0].outcome == Repair::Outcome::kNobodyToAsk);
  CHECK_FALSE(fs::exists(file));
  const auto done = repair({problem("touch " + file)}, true, {});
  CHECK(done.at(0).outcome == Repair::Outcome::kDone);
  CHECK(fs::exists(file));
}

TEST_CASE("Only harmless commands of problems and warnings are offered, each once") {
  const MadeUpSystem folder;
  const std::string file = folder.path() / "lines";
  const Terminal nobody(nullptr);
  const std::string add = "echo line >> " + file;
  Finding good = problem("false");
  good.verdict = Finding::Verdict::kGood;
  Finding warning = problem(add);
  warning.verdict = Finding::Verdict::kWarning;
  const auto done = repair({problem(add), problem("false", false), good, problem(""), warning}, true, {});
  REQUIRE(done.size() == 1);
  std::ifstream lines(file);
  CHECK(std::string(std::istreambuf_iterator<char>(lines), {}) == "line\n");
}

TEST_CASE("A command that fails is told with its status, and the next one still runs") {
  const Terminal nobody(nullptr);
  const auto done = repair({problem("exit 3"), problem("true")}, true, {});
  REQUIRE(done.size() == 2);
  CHECK(done[0].outcome == Repair::Outcome::kFailed);
  CHECK(done[0].exit_status == 3);
  CHECK(done[1].outcome == Repair::Outcome::kDone);
}

TEST_CASE("A stop ends the command under way and starts no other") {
  const MadeUpSystem folder;
  const std::string file = folder.path() / "made";
  const Terminal nobody(nullptr);
  std::stop_source stop;
  stop.request_stop();
  CHECK(repair({problem("touch " + file)}, true, stop.get_token()).empty());
  CHECK_FALSE(fs::exists(file));
}
