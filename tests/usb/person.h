// A program that somebody runs at a terminal: what it asks there, what is typed, and its standard output
// apart.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <string>
#include <vector>

namespace scatter::usb_test {

struct Ended {
  int status = -1;   ///< The exit status, 128 + signal when killed; -1: it did not end and was killed.
  std::string out;   ///< Standard output.
  std::string said;  ///< What the terminal showed: standard error and what was typed.
};

class Person {
 public:
  /// Standard input and error are a terminal, or with `nobody` a pipe that is at its end and one that is
  /// read.
  explicit Person(std::vector<std::string> words, bool nobody = false) {
    std::array<int, 2> out{};
    std::array<int, 2> error{};
    int input = -1;
    if (::pipe2(out.data(), O_CLOEXEC) != 0 || ::pipe2(error.data(), O_CLOEXEC) != 0) {
      throw std::runtime_error("no pipe");
    }
    if (nobody) {
      input = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    } else {
      ::close(error[0]);
      ::close(error[1]);
      if (::openpty(&error[0], &error[1], nullptr, nullptr, nullptr) != 0) {
        throw std::runtime_error("no terminal");
      }
      ::fcntl(error[0], F_SETFD, FD_CLOEXEC);
      ::fcntl(error[1], F_SETFD, FD_CLOEXEC);
      input = error[1];
    }
    std::vector<char*> arguments;
    for (std::string& word : words) {
      arguments.push_back(word.data());
    }
    arguments.push_back(nullptr);
    process_ = ::fork();
    if (process_ == 0) {
      if (!nobody) {
        ::setsid();
        ::ioctl(input, TIOCSCTTY, 0);  // So that a typed ctrl-C is a signal.
      }
      ::dup2(input, 0);
      ::dup2(out[1], 1);
      ::dup2(error[1], 2);
      ::execvp(arguments.front(), arguments.data());
      ::_exit(127);
    }
    ::close(out[1]);
    ::close(error[1]);
    if (nobody) {
      ::close(input);
    }
    out_ = out[0];
    terminal_ = error[0];
  }
  ~Person() {
    if (process_ > 0) {
      ::kill(process_, SIGKILL);
      ::waitpid(process_, nullptr, 0);
    }
    ::close(out_);
    ::close(terminal_);
  }
  Person(const Person&) = delete;
  Person& operator=(const Person&) = delete;

  [[nodiscard]] pid_t process() const { return process_; }
  /// Reads on until the terminal has shown `text` since the last call; false: it ended without, or took 10 s.
  [[nodiscard]] bool sees(const std::string& text) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    std::size_t found = ended_.said.find(text, seen_);
    while (found == std::string::npos && listen(end)) {
      found = ended_.said.find(text, seen_);
    }
    seen_ = found == std::string::npos ? seen_ : found + text.size();
    return found != std::string::npos;
  }
  void types(const std::string& text) const { (void)!::write(terminal_, text.data(), text.size()); }
  /// Everything to its end; after `limit` it is killed.
  Ended ends(std::chrono::milliseconds limit = std::chrono::seconds(20)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (listen(end)) {
    }
    int status = 0;
    while (::waitpid(process_, &status, WNOHANG) == 0) {
      if (std::chrono::steady_clock::now() > end) {
        return ended_;
      }
      ::usleep(1000);
    }
    process_ = -1;
    ended_.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    return ended_;
  }

 private:
  /// Something more from either; false at the end of both and after `end`.
  bool listen(std::chrono::steady_clock::time_point end) {
    std::array<pollfd, 2> files{
        {{out_open_ ? out_ : -1, POLLIN, 0}, {said_open_ ? terminal_ : -1, POLLIN, 0}}};
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if ((!out_open_ && !said_open_) || left.count() <= 0 ||
        ::poll(files.data(), files.size(), static_cast<int>(left.count())) <= 0) {
      return false;
    }
    std::array<char, 4096> bytes{};
    for (std::size_t k = 0; k < files.size(); ++k) {
      if (files.at(k).revents != 0) {
        const ssize_t got = ::read(files.at(k).fd, bytes.data(), bytes.size());
        (k == 0 ? out_open_ : said_open_) = got > 0;
        (k == 0 ? ended_.out : ended_.said).append(bytes.data(), got > 0 ? static_cast<std::size_t>(got) : 0);
      }
    }
    return true;
  }

  pid_t process_ = -1;
  int out_ = -1;
  int terminal_ = -1;
  bool out_open_ = true;
  bool said_open_ = true;
  std::size_t seen_ = 0;
  Ended ended_;
};

}  // namespace scatter::usb_test
