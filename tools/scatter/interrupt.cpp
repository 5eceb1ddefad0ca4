#include "tools/scatter/interrupt.h"

#include <unistd.h>

#include <csignal>
#include <thread>

namespace scatter::cli {

std::stop_token stop_on_interrupt() {
  std::signal(SIGPIPE, SIG_IGN);
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  // Blocked everywhere and taken by one thread: a stop may then be requested, which a signal handler
  // must not do.
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  // Never freed: the waiting thread lives until the process ends.
  auto* const source = new std::stop_source;
  std::thread([signals, source] {
    int signal = 0;
    sigwait(&signals, &signal);
    source->request_stop();
    sigwait(&signals, &signal);
    _exit(1);
  }).detach();
  return source->get_token();
}

}  // namespace scatter::cli
