#include "tests/unit/tools/command.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <thread>

extern char** environ;

namespace fs = std::filesystem;

Scratch::Scratch() {
  std::string name = (fs::temp_directory_path() / "scatter-test-XXXXXX").string();
  folder_ = mkdtemp(name.data());
}
Scratch::~Scratch() {
  std::error_code error;
  fs::remove_all(folder_, error);
}

Command::Command(const std::vector<std::string>& arguments, const fs::path& out)
    : out_(out.empty() ? scratch_ / "out" : out) {
  std::vector<std::string> words = {SCATTER_BINARY};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (auto& word : words) {
    argv.push_back(word.data());
  }
  argv.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, out_.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, (scratch_ / "err").c_str(), O_WRONLY | O_CREAT,
                                   0600);
  if (posix_spawn(&pid_, argv.front(), &files, nullptr, argv.data(), environ) != 0) {
    pid_ = -1;
  }
  posix_spawn_file_actions_destroy(&files);
}

Command::~Command() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
}

void Command::signal(int number) const {
  if (pid_ > 0) {
    kill(pid_, number);
  }
}

std::string Command::output() const {
  return contents(out_);
}

Finished Command::wait(std::chrono::seconds limit) {
  Finished result;
  const auto end = std::chrono::steady_clock::now() + limit;
  int status = 0;
  while (pid_ > 0 && waitpid(pid_, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > end) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
      pid_ = -1;
      break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  if (pid_ > 0) {
    result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  pid_ = -1;
  result.out = fs::is_regular_file(out_) ? output() : "";
  result.err = contents(scratch_ / "err");
  return result;
}

Finished scatter(const std::vector<std::string>& arguments) {
  return Command(arguments).wait();
}

std::string contents(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}
