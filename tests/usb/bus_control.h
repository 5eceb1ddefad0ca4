// A test's hand on the mocked bus that it runs on: plugs, faults, conditions, figures.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

namespace scatter::usb_test {

/// What the mock has counted (mock_bus/tally.h).
using Statistics = std::map<std::string, std::uint64_t>;

/// One connection to the mock. Each call returns when the change is in force and the news of it is out.
/// Throws std::runtime_error where the mock refuses, or the program does not run under mock_bus.
class BusControl {
 public:
  BusControl() : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const char* const path = std::getenv("SCATTER_MOCK_BUS");
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path != nullptr ? path : "", sizeof address.sun_path - 1);
    if (path == nullptr ||
        ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("this program wants to run under mock_bus");
    }
  }
  ~BusControl() { ::close(socket_); }
  BusControl(const BusControl&) = delete;
  BusControl& operator=(const BusControl&) = delete;

  void unplug(int slot = 0) { ask("unplug " + std::to_string(slot)); }
  void plug(int slot = 0, int speed_mbps = 480) {
    ask("plug " + std::to_string(slot) + " " + std::to_string(speed_mbps));
  }
  /// The hub loses power: transfers fail, and the device leaves 60 ms later.
  void cut_power(int slot = 0) { ask("cut_power " + std::to_string(slot)); }
  void press_button(int slot = 0) { ask("press " + std::to_string(slot)); }
  /// A further instrument in a socket of its own, not plugged in. Gives the socket's number.
  int add_instrument(const std::string& query) { return std::stoi(ask("add " + query)); }
  /// An instrument whose firmware speaks only this wire major, not plugged in. It refuses HELLO as SPEC 6.4
  /// says, or answers in frames of its own wire major.
  int add_of_other_wire(int major, bool refuses, const std::string& query) {
    return std::stoi(ask("add_of_other_wire " + std::to_string(major) + (refuses ? " 1 " : " 0 ") + query));
  }
  /// A device of somebody else's with our vendor and product numbers, not plugged in.
  int add_stranger() { return std::stoi(ask("add_stranger")); }
  /// From now on, also for devices that come.
  void set_access(bool allowed) { ask(allowed ? "access 1" : "access 0"); }
  /// A program that cannot be seen holds the interface.
  void hold_interface(int interface, bool held) {
    ask("hold 0 " + std::to_string(interface) + (held ? " 1" : " 0"));
  }
  /// The kernel is slow to give back what devices send: it keeps that until it is told otherwise.
  void hold_received(bool held) { ask(held ? "hold_received 1" : "hold_received 0"); }
  /// The kernel is slow to tell what became of transfers to devices, also of cancelled ones.
  void hold_sent(bool held) { ask(held ? "hold_sent 1" : "hold_sent 0"); }
  /// The limit of usbfs for transfers under way; usbfs_memory_mb shows it rounded up.
  void set_memory(int bytes) { ask("memory " + std::to_string(bytes)); }
  /// Descriptors of devices to come are cut to so many bytes; -1: whole again.
  void cut_descriptors(int bytes) { ask("garble " + std::to_string(bytes)); }
  /// Behind the device descriptor come random bytes, for devices to come; 0: the true ones again.
  void scramble_descriptors(std::uint32_t seed) { ask("scramble " + std::to_string(seed)); }
  /// The kernel has usbhid, for devices to come.
  void set_hid_driver(bool there) { ask(there ? "hid_driver 1" : "hid_driver 0"); }
  /// The device stops answering; plugging ends it.
  void hang(int slot = 0, bool hung = true) { ask("hang " + std::to_string(slot) + (hung ? " 1" : " 0")); }
  /// A program may end with transfers under way: it is going to be killed.
  void allow_abandoned() { ask("may_abandon 1"); }

  [[nodiscard]] Statistics statistics() {
    Statistics result;
    std::istringstream words(ask("statistics"));
    for (std::string word; words >> word;) {
      const std::size_t equal = word.find('=');
      result[word.substr(0, equal)] = std::stoull(word.substr(equal + 1));
    }
    return result;
  }

 private:
  std::string ask(const std::string& request) {
    const std::string line = request + "\n";
    std::string answer;
    if (::send(socket_, line.data(), line.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(line.size())) {
      for (char letter = 0; ::recv(socket_, &letter, 1, 0) == 1 && letter != '\n';) {
        answer.push_back(letter);
      }
    }
    if (!answer.starts_with("ok")) {
      throw std::runtime_error(request + ": " + (answer.empty() ? "the mock has gone" : answer));
    }
    return answer.size() > 3 ? answer.substr(3) : "";
  }

  int socket_;
};

}  // namespace scatter::usb_test
