// A program that a test starts, listens to and kills.
#pragma once

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

namespace scatter::usb_test {

class Child {
 public:
  /// Both outputs go into one pipe. `foreign`: none of our programs, so its leaks are its own.
  explicit Child(std::vector<std::string> words, bool foreign = false) {
    std::array<int, 2> pipe{};
    if (::pipe2(pipe.data(), O_CLOEXEC) != 0) {
      throw std::runtime_error("no pipe");
    }
    // Nothing is allocated between fork and exec: other threads may hold the allocator.
    std::vector<char*> arguments;
    for (std::string& word : words) {
      arguments.push_back(word.data());
    }
    arguments.push_back(nullptr);
    std::vector<char*> environment;
    std::string sanitizer = "ASAN_OPTIONS=verify_asan_link_order=0:detect_leaks=0";
    for (char** each = ::environ; *each != nullptr; ++each) {
      if (!foreign || std::string(*each).rfind("ASAN_OPTIONS=", 0) != 0) {
        environment.push_back(*each);
      }
    }
    if (foreign) {
      environment.push_back(sanitizer.data());
    }
    environment.push_back(nullptr);
    process_ = ::fork();
    if (process_ == 0) {
      ::dup2(pipe[1], 1);
      ::dup2(pipe[1], 2);
      ::execvpe(arguments.front(), arguments.data(), environment.data());
      ::_exit(127);
    }
    ::close(pipe[1]);
    output_ = pipe[0];
  }
  ~Child() {
    kill();
    ::close(output_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  [[nodiscard]] pid_t process() const { return process_; }
  /// Up to the end of a line; "" at the end of the output.
  [[nodiscard]] std::string line() {
    std::string text;
    for (char letter = 0; ::read(output_, &letter, 1) == 1 && letter != '\n';) {
      text.push_back(letter);
    }
    return text;
  }
  /// All output, and then how it ended: the exit status, 128 + signal when killed.
  int wait(std::string& output) {
    char letter = 0;
    while (::read(output_, &letter, 1) == 1) {
      output.push_back(letter);
    }
    return reap();
  }
  /// Without a word, as the kernel does it for lack of memory.
  void kill() {
    if (process_ > 0) {
      ::kill(process_, SIGKILL);
      reap();
    }
  }

 private:
  int reap() {
    int status = 0;
    ::waitpid(process_, &status, 0);
    process_ = -1;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  }

  pid_t process_ = -1;
  int output_ = -1;
};

}  // namespace scatter::usb_test
