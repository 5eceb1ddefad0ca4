#include "simulator/emulator/qemu_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace scatter::simulator {
namespace {

constexpr std::chrono::milliseconds kStartTimeout{30'000};
// Numbers of the child's ends of its lines.
constexpr int kFirstLine = 3;
constexpr std::size_t kLines = 3;

std::unexpected<Error> refused(std::string_view step) {
  return fail(ErrorCode::kUnavailable, fmt::format("cannot start QEMU: {}: {}", step, std::strerror(errno)),
              "check the limits of this account (ulimit -a), then try again");
}

/// Where the shell would find a program; empty: nowhere.
std::string find_program(std::string_view name) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "/usr/bin:/bin";
  while (!rest.empty()) {
    const std::size_t end = rest.find(':');
    const std::string candidate = fmt::format("{}/{}", rest.substr(0, end), name);
    struct stat info{};
    if (::stat(candidate.c_str(), &info) == 0 && S_ISREG(info.st_mode) &&
        ::access(candidate.c_str(), X_OK) == 0) {
      return candidate;
    }
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  }
  return {};
}

/// QEMU takes a comma inside an option's value doubled.
std::string escaped(const std::filesystem::path& file) {
  std::string text;
  for (const char c : file.string()) {
    text += c;
    if (c == ',') {
      text += c;
    }
  }
  return text;
}

std::vector<std::string> arguments(const QemuFiles& files) {
  std::vector<std::string> list{
      std::string(QemuProcess::kProgram),
      "-M",
      "mps2-an500,memory-backend=ps",
      "-accel",
      "tcg,tb-size=64",
      "-S",
      "-display",
      "none",
      "-monitor",
      "none",
      "-parallel",
      "none",
      "-object",
      fmt::format("memory-backend-file,id=ps,size=16M,mem-path={},share=on", escaped(files.shared_memory)),
      "-kernel",
      files.kernel.string()};
  for (const auto* line : {"u0", "u1", "qmp"}) {
    const std::size_t k = static_cast<std::size_t>(line[0] == 'q' ? 2 : line[1] - '0');
    list.insert(list.end(), {"-chardev", fmt::format("socket,id={},fd={}", line, kFirstLine + k)});
  }
  list.insert(list.end(),
              {"-serial", "chardev:u0", "-serial", "chardev:u1", "-mon", "chardev=qmp,mode=control",
               "-device", "tmp105,address=0x48,id=sensor", "-device", "tmp105,address=0x49,id=led_board"});
  if (!files.eeprom.empty()) {
    list.insert(
        list.end(),
        {"-drive", fmt::format("if=none,id=ee,format=raw,file={}", escaped(files.eeprom)), "-device",
         fmt::format("at24c-eeprom,address=0x50,rom-size={},drive=ee,id=eeprom", QemuProcess::kEepromBytes)});
  }
  return list;
}

/// In the child: only calls that are safe after fork() in a program with threads.
[[noreturn]] void become_qemu(const char* program, char* const* argv, const std::array<int, kLines>& lines,
                              int words, pid_t parent) {
  ::setpgid(0, 0);  // A Ctrl-C at the terminal is for the parent, which ends QEMU in order.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) {
    ::_exit(127);
  }
  // First out of the way of the numbers that the lines shall get.
  std::array<int, kLines> moved{};
  for (std::size_t k = 0; k < kLines; ++k) {
    moved[k] = ::fcntl(lines[k], F_DUPFD, 64);
  }
  ::dup2(words, STDERR_FILENO);
  const int nothing = ::open("/dev/null", O_RDWR);
  ::dup2(nothing, STDIN_FILENO);
  ::dup2(nothing, STDOUT_FILENO);
  for (std::size_t k = 0; k < kLines; ++k) {
    ::dup2(moved[k], kFirstLine + static_cast<int>(k));
    ::close(moved[k]);
  }
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::execv(program, argv);
  ::_exit(127);
}

void unblock(const FileDescriptor& line) {
  ::fcntl(line.number(), F_SETFL, ::fcntl(line.number(), F_GETFL) | O_NONBLOCK);
}

}  // namespace

Result<QemuProcess> QemuProcess::start(const QemuFiles& files) {
  const std::string program = find_program(kProgram);
  if (program.empty()) {
    return fail(ErrorCode::kNotFound, fmt::format("{} is not installed: no such program in PATH", kProgram),
                "install it (Debian and Ubuntu: apt install qemu-system-arm), or simulate without --board");
  }
  QemuProcess process;
  std::array<FileDescriptor, kLines> ours;
  std::array<FileDescriptor, kLines> theirs;
  std::array<int, kLines> numbers{};
  for (std::size_t k = 0; k < kLines; ++k) {
    int pair[2] = {-1, -1};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0) {
      return refused("socketpair");
    }
    ours[k] = FileDescriptor(pair[0]);
    theirs[k] = FileDescriptor(pair[1]);
    numbers[k] = pair[1];
  }
  process.words_ = FileDescriptor(::memfd_create("qemu-stderr", MFD_CLOEXEC));
  if (!process.words_.open()) {
    return refused("memfd_create");
  }
  const std::vector<std::string> list = arguments(files);
  std::vector<char*> argv;
  for (const std::string& each : list) {
    argv.push_back(const_cast<char*>(each.c_str()));
  }
  argv.push_back(nullptr);
  const pid_t parent = ::getpid();
  process.id_ = ::fork();
  if (process.id_ < 0) {
    return refused("fork");
  }
  if (process.id_ == 0) {
    become_qemu(program.c_str(), argv.data(), numbers, process.words_.number(), parent);
  }
  process.ended_ = FileDescriptor(static_cast<int>(::syscall(SYS_pidfd_open, process.id_, 0)));
  process.uart0_ = std::move(ours[0]);
  process.uart1_ = std::move(ours[1]);
  process.control_ = QmpClient(std::move(ours[2]));
  for (FileDescriptor& each : theirs) {
    each.close();
  }
  if (!process.ended_.open()) {
    return refused("pidfd_open");
  }
  unblock(process.uart0_);
  unblock(process.uart1_);
  if (Status ready = process.control_.negotiate(kStartTimeout); !ready) {
    if (const Status alive = process.check(); !alive) {
      return fail(ErrorCode::kFailedPrecondition, alive.error().what, alive.error().remedy);
    }
    return std::unexpected(ready.error());
  }
  return process;
}

QemuProcess::QemuProcess(QemuProcess&& other) noexcept
    : id_(std::exchange(other.id_, -1)),
      exit_status_(other.exit_status_),
      ended_(std::move(other.ended_)),
      words_(std::move(other.words_)),
      uart0_(std::move(other.uart0_)),
      uart1_(std::move(other.uart1_)),
      control_(std::move(other.control_)) {}

QemuProcess& QemuProcess::operator=(QemuProcess&& other) noexcept {
  if (this != &other) {
    kill();
    id_ = std::exchange(other.id_, -1);
    exit_status_ = other.exit_status_;
    ended_ = std::move(other.ended_);
    words_ = std::move(other.words_);
    uart0_ = std::move(other.uart0_);
    uart1_ = std::move(other.uart1_);
    control_ = std::move(other.control_);
  }
  return *this;
}

QemuProcess::~QemuProcess() {
  kill();
}

void QemuProcess::kill() noexcept {
  if (id_ > 0) {
    ::kill(id_, SIGKILL);
    while (::waitpid(id_, &exit_status_, 0) < 0 && errno == EINTR) {
    }
    id_ = -1;
  }
}

Status QemuProcess::resume() {
  return control_.execute("cont", "", kStartTimeout);
}

Status QemuProcess::check() {
  if (id_ > 0) {
    // A process that closes its lines is about to end.
    pollfd file{ended_.number(), POLLIN, 0};
    pollfd line{uart1_.number(), 0, 0};
    const bool leaving = ::poll(&line, 1, 0) > 0 && (line.revents & (POLLHUP | POLLERR)) != 0;
    if (::poll(&file, 1, leaving ? 1000 : 0) <= 0) {
      return {};
    }
    while (::waitpid(id_, &exit_status_, 0) < 0 && errno == EINTR) {
    }
    id_ = -1;
  }
  const std::string how = WIFSIGNALED(exit_status_)
                              ? fmt::format("was killed by signal {}", WTERMSIG(exit_status_))
                              : fmt::format("ended with status {}", WEXITSTATUS(exit_status_));
  const std::string words = last_words();
  return fail(ErrorCode::kDisconnected, fmt::format("QEMU {}{}{}", how, words.empty() ? "" : ": ", words),
              "start the simulator again; the board's state is as after a power cut");
}

std::string QemuProcess::last_words() const {
  struct stat info{};
  std::array<char, 512> bytes{};
  if (::fstat(words_.number(), &info) != 0) {
    return {};
  }
  const off_t from = std::max<off_t>(0, info.st_size - static_cast<off_t>(bytes.size()));
  const ssize_t count = ::pread(words_.number(), bytes.data(), bytes.size(), from);
  std::string text(bytes.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) {
    text.pop_back();
  }
  std::ranges::replace(text, '\n', ' ');
  return text;
}

}  // namespace scatter::simulator
