#include "tools/scatter/button_signal.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <utility>

namespace scatter::cli {
namespace {

std::atomic<int> g_pressed{-1};

void count_press(int event) noexcept {
  const std::uint64_t one = 1;
  (void)!::write(event, &one, sizeof one);
}

extern "C" void on_button_signal(int /*signal*/) {
  const int before = errno;
  count_press(g_pressed.load());
  errno = before;
}

void handle(void (*handler)(int)) {
  struct sigaction action{};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGUSR1, &action, nullptr);
}

}  // namespace

ButtonSignal::ButtonSignal(std::function<void()> press) : pressed_(::eventfd(0, EFD_CLOEXEC)) {
  g_pressed = pressed_;
  handle(on_button_signal);
  thread_ = std::thread([this, pressed = std::move(press)] {
    while (true) {
      std::uint64_t count = 0;
      if (::read(pressed_, &count, sizeof count) != sizeof count && errno != EINTR) {
        return;
      }
      if (over_) {
        return;
      }
      for (; count > 0; --count) {
        pressed();
      }
    }
  });
}

ButtonSignal::~ButtonSignal() {
  handle(SIG_IGN);
  over_ = true;
  count_press(pressed_);
  thread_.join();
  g_pressed = -1;
  ::close(pressed_);
}

}  // namespace scatter::cli
