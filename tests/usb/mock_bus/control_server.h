// The socket that tests steer the mocked bus by: one line in, one line out.
#pragma once

#include <functional>
#include <list>
#include <string>
#include <vector>

#include "tests/usb/mock_bus/file_descriptor.h"

struct pollfd;

namespace scatter::mock_bus {

class ControlServer {
 public:
  using Request = std::function<std::string(const std::string& line)>;
  /// Throws std::runtime_error when the socket cannot be made.
  ControlServer(std::string path, Request request);
  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  void add_waits(std::vector<pollfd>& files) const;
  bool serve();

 private:
  struct Client {
    FileDescriptor socket;
    std::string line;  ///< So far.
  };
  std::string path_;
  Request request_;
  FileDescriptor listener_;
  std::list<Client> clients_;
};

}  // namespace scatter::mock_bus
