// mock_bus [QUERY...] [--speed 12|480] [--wire MAJOR] [--unplugged] [--stranger] [--uninstrumented]
//          -- COMMAND [ARGUMENT...]
//
// Runs COMMAND on a machine whose USB bus is a mock with simulated instruments on it, and ends as it ends; or
// with 3 where the command was content and its use of the bus was not correct.
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "protocol/frame.h"
#include "tests/usb/mock_bus/mock_bus.h"
#include "tests/usb/mock_bus/stranger.h"

namespace {

using scatter::mock_bus::FileDescriptor;
using scatter::mock_bus::MockBus;

struct Arguments {
  std::vector<std::string> queries;
  unsigned speed = 480;
  bool plugged = true;
  bool stranger = false;
  std::uint8_t wire_major = scatter::protocol::kWireMajor;  ///< Of the instruments' firmware.
  bool instrumented = true;                                 ///< The command was built as this program was.
  std::vector<char*> command;
};

constexpr int kUsage = 2;
constexpr int kMisused = 3;

/// Ends the program when they are wrong.
Arguments parse(int count, char** words) {
  Arguments arguments;
  int k = 1;
  for (; k < count && std::string_view(words[k]) != "--"; ++k) {
    const std::string_view word = words[k];
    if (word == "--speed" && k + 1 < count) {
      arguments.speed = static_cast<unsigned>(std::atoi(words[++k]));
    } else if (word == "--wire" && k + 1 < count) {
      arguments.wire_major = static_cast<std::uint8_t>(std::atoi(words[++k]));
    } else if (word == "--unplugged") {
      arguments.plugged = false;
    } else if (word == "--stranger") {
      arguments.stranger = true;
    } else if (word == "--uninstrumented") {
      arguments.instrumented = false;
    } else if (!word.starts_with("--")) {
      arguments.queries.emplace_back(word);
    } else {
      fmt::print(stderr, "mock_bus: unknown option {}\n", word);
      std::exit(kUsage);
    }
  }
  arguments.command.assign(words + std::min(k + 1, count), words + count);
  if (arguments.command.empty() || (arguments.speed != 12 && arguments.speed != 480)) {
    fmt::print(stderr,
               "usage: mock_bus [QUERY...] [--speed 12|480] [--wire MAJOR] [--unplugged] [--stranger] "
               "[--uninstrumented] -- COMMAND [ARGUMENT...]\n");
    std::exit(kUsage);
  }
  return arguments;
}

/// The sanitizer's library that this program runs with: it must be loaded before any other.
std::string sanitizer_runtime() {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const std::size_t path = line.find('/');
    if (path != std::string::npos &&
        (line.find("/libasan.so") != std::string::npos || line.find("/libtsan.so") != std::string::npos)) {
      return line.substr(path);
    }
  }
  return "";
}

[[noreturn]] void become(const Arguments& arguments, const MockBus& bus, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) {
    ::_exit(kMisused);
  }
  // Permissions of device files shall count for root, too: no CAP_DAC_OVERRIDE, no CAP_DAC_READ_SEARCH.
  for (const int capability : {1, 2}) {
    ::prctl(PR_CAPBSET_DROP, capability);
  }
  std::string preload = SCATTER_UMOCKDEV_PRELOAD;
  if (const std::string runtime = sanitizer_runtime(); !runtime.empty() && arguments.instrumented) {
    preload = runtime + ":" + preload;
    const char* const options = std::getenv("ASAN_OPTIONS");
    ::setenv("ASAN_OPTIONS",
             fmt::format("{}{}verify_asan_link_order=0", options != nullptr ? options : "",
                         options != nullptr ? ":" : "")
                 .c_str(),
             1);
  }
  ::setenv("LD_PRELOAD", preload.c_str(), 1);
  ::setenv("UMOCKDEV_DIR", bus.testbed().root().c_str(), 1);
  ::setenv("SCATTER_MOCK_BUS", bus.control_path().c_str(), 1);
  std::vector<char*> words = arguments.command;
  words.push_back(nullptr);
  ::execvp(words.front(), words.data());
  std::perror(words.front());
  ::_exit(127);
}

volatile sig_atomic_t child = 0;

void pass_on(int signal) {
  if (child > 0) {
    ::kill(child, signal);
  }
}

int run(const Arguments& arguments) {
  MockBus bus;
  for (const std::string& query : arguments.queries) {
    const scatter::Result<int> added = arguments.wire_major == scatter::protocol::kWireMajor
                                           ? bus.add_instrument(query)
                                           : bus.add_of_other_wire(query, arguments.wire_major, true);
    if (!added) {
      fmt::print(stderr, "mock_bus: {}\n", added.error().what);
      return kUsage;
    }
  }
  const int instruments = static_cast<int>(arguments.queries.size());
  if (arguments.stranger) {
    bus.plug(bus.add(std::make_unique<scatter::mock_bus::Stranger>()), 480);
  }
  for (int k = 0; k < instruments && arguments.plugged; ++k) {
    bus.plug(k, arguments.speed);
  }
  const pid_t parent = ::getpid();
  const pid_t process = ::fork();
  if (process == 0) {
    become(arguments, bus, parent);
  }
  child = process;
  std::signal(SIGINT, pass_on);
  std::signal(SIGTERM, pass_on);
  const FileDescriptor ended(static_cast<int>(::syscall(SYS_pidfd_open, process, 0)));
  if (process < 0 || !ended.open()) {
    std::perror("mock_bus: cannot start the command");
    return kUsage;
  }
  bus.serve_until(ended.number());
  int status = 0;
  ::waitpid(process, &status, 0);
  const std::vector<std::string> complaints = bus.complaints();
  for (const std::string& complaint : complaints) {
    fmt::print(stderr, "mock_bus: {}\n", complaint);
  }
  if (WIFSIGNALED(status)) {
    fmt::print(stderr, "mock_bus: the command was ended by signal {}\n", WTERMSIG(status));
    return 128 + WTERMSIG(status);
  }
  const int code = WEXITSTATUS(status);
  return code == 0 && !complaints.empty() ? kMisused : code;
}

}  // namespace

int main(int count, char** words) {
  try {
    return run(parse(count, words));
  } catch (const std::exception& error) {
    fmt::print(stderr, "mock_bus: {}\n", error.what());
    return kUsage;
  }
}
