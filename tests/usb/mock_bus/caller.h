// Calls that programs under umockdev's preloaded library make on a device file, and the answers to them.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <span>
#include <vector>

#include "tests/usb/mock_bus/file_descriptor.h"

struct pollfd;

namespace scatter::mock_bus {

/// How long after a device file has gone a program that had just found it may still come.
inline constexpr std::chrono::seconds kLateOpens{1};

/// One call: ioctl(file, code, address), or read or write of `size` bytes at `address`.
struct Call {
  enum class Kind : std::uint8_t { kIoctl = 1, kRead = 7, kWrite = 8 };
  Kind kind = Kind::kIoctl;
  unsigned long code = 0;
  std::uint64_t address = 0;  ///< In the program's memory; for some ioctls the argument itself.
  std::size_t size = 0;
};

/// One open of a device file. The library sends each call through a socket and serves requests for the
/// program's memory until the answer comes (struct ioctl_request of umockdev's libumockdev-preload.c).
class Caller {
 public:
  /// The library then makes the call on the real file.
  static constexpr long kUnhandled = -100;

  explicit Caller(FileDescriptor socket);
  [[nodiscard]] int number() const noexcept { return socket_.number(); }
  [[nodiscard]] pid_t process() const noexcept { return process_; }
  /// False: the program has closed the file, or is gone.
  [[nodiscard]] bool alive() const noexcept { return alive_; }

  /// Next call; false when the file was closed.
  [[nodiscard]] bool receive(Call& call);
  // During a call.
  [[nodiscard]] bool read_memory(std::uint64_t address, std::span<std::byte> out);
  void write_memory(std::uint64_t address, std::span<const std::byte> bytes);
  template <typename T>
  [[nodiscard]] bool read_object(std::uint64_t address, T& out) {
    return read_memory(address, std::as_writable_bytes(std::span(&out, 1)));
  }
  template <typename T>
  void write_object(std::uint64_t address, const T& object) {
    write_memory(address, std::as_bytes(std::span(&object, 1)));
  }
  /// Ends the call; `error` is an errno when result < 0.
  void answer(long result, int error = 0);

 private:
  void send(unsigned long command, std::uint64_t first, std::uint64_t second,
            std::span<const std::byte> bytes);

  FileDescriptor socket_;
  pid_t process_ = 0;
  bool alive_ = true;
};

/// What a device file does.
class FileHandler {
 public:
  virtual void opened(Caller& caller) = 0;
  /// Answers now or later; no other call of this caller comes before that.
  virtual void called(Caller& caller, const Call& call) = 0;
  /// Of a closed file. `caller` is not used after that.
  virtual void closed(Caller& caller) = 0;
  virtual ~FileHandler() = default;
};

/// The socket of one device file. The library ends a program that finds the file and not the socket, so a
/// server outlives the file by a moment.
class CallServer {
 public:
  /// Throws std::runtime_error when the socket cannot be made.
  CallServer(const std::filesystem::path& socket_path, FileHandler& handler);
  /// The handler hears of no more closed files: it may be half gone itself.
  ~CallServer();
  CallServer(const CallServer&) = delete;
  CallServer& operator=(const CallServer&) = delete;

  void add_waits(std::vector<pollfd>& files) const;
  /// Takes what has come. True when something did.
  bool serve();
  [[nodiscard]] bool in_use() const noexcept { return !callers_.empty(); }

 private:
  std::filesystem::path path_;
  unsigned long identity_ = 0;  ///< Of the socket's file: a later device may have put its own there.
  FileHandler& handler_;
  FileDescriptor listener_;
  std::list<std::unique_ptr<Caller>> callers_;
};

}  // namespace scatter::mock_bus
