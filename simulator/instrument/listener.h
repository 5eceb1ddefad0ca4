// A listening socket on tcp:HOST:PORT or unix:PATH.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::simulator {

/// A POSIX file descriptor that closes itself.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int number) noexcept : number_(number) {}
  FileDescriptor(FileDescriptor&& other) noexcept : number_(other.release()) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept;
  ~FileDescriptor();
  [[nodiscard]] int number() const noexcept { return number_; }
  [[nodiscard]] bool open() const noexcept { return number_ >= 0; }
  int release() noexcept;
  void close() noexcept;

 private:
  int number_ = -1;
};

/// Threads: one.
class Listener {
 public:
  /// Port 0 takes a free one; see address(). A socket file that nobody serves any more is taken over.
  /// Errors    kInvalidArgument: not an address, or not this computer's loopback without
  ///           `allow_remote`; kBusy: somebody serves there; kPermissionDenied, kNotFound: the system
  ///           refuses.
  [[nodiscard]] static Result<Listener> open(std::string_view address, bool allow_remote);
  Listener(Listener&& other) noexcept;
  Listener& operator=(Listener&&) = delete;
  /// Removes the socket file.
  ~Listener();

  [[nodiscard]] int number() const noexcept { return socket_.number(); }
  /// As a URI that a host can open, with the true port.
  [[nodiscard]] const std::string& address() const noexcept { return address_; }
  /// Non-blocking connection, or a closed descriptor when none waits.
  [[nodiscard]] FileDescriptor accept(std::string& peer);

 private:
  Listener() = default;
  static Result<Listener> open_tcp(std::string_view place, bool allow_remote);
  static Result<Listener> open_unix(const std::string& path);

  FileDescriptor socket_;
  std::string address_;
  std::string unix_path_;  ///< "" for tcp.
  std::uint64_t unix_inode_ = 0;
};

}  // namespace scatter::simulator
