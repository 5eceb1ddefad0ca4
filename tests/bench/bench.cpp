#include "tests/bench/bench.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <utility>

#include "tests/bench/registry.h"

namespace scatter::bench {

namespace {

double seconds_of(const std::function<void()>& call, long calls) {
  const auto begin = std::chrono::steady_clock::now();
  for (long i = 0; i < calls; ++i) {
    call();
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// Also warms caches, page tables and the clock.
long calls_for(const std::function<void()>& call, double seconds) {
  long calls = 1;
  for (;;) {
    const double taken = seconds_of(call, calls);
    if (taken >= seconds) {
      return calls;
    }
    const double growth = taken > 0.0 ? std::clamp(1.2 * seconds / taken, 2.0, 100.0) : 100.0;
    calls = static_cast<long>(static_cast<double>(calls) * growth);
  }
}

}  // namespace

double cpu_seconds_of(const std::function<void()>& call) {
  const auto now = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const double begin = now();
  call();
  return now() - begin;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<Entry>& registry() {
  static std::vector<Entry> entries;
  return entries;
}

Benchmark::Benchmark(std::string name, std::function<std::vector<Figure>()> run) {
  registry().push_back({std::move(name), std::move(run)});
}

Figure make_figure(std::string name, double value, std::string unit, std::string peer, double peer_value,
                   Better better) {
  const double ratio = better == Better::kHigher ? value / peer_value : peer_value / value;
  return {std::move(name), value, std::move(unit), std::move(peer), peer_value, ratio};
}

Figure run_contest(std::string name, const Contest& contest) {
  const long our_calls = calls_for(contest.ours, contest.round_seconds);
  const long their_calls = calls_for(contest.theirs, contest.round_seconds);
  std::vector<double> ours;
  std::vector<double> theirs;
  const auto run_ours = [&] {
    ours.push_back(contest.work * static_cast<double>(our_calls) / seconds_of(contest.ours, our_calls));
  };
  const auto run_theirs = [&] {
    theirs.push_back(contest.work * static_cast<double>(their_calls) /
                     seconds_of(contest.theirs, their_calls));
  };
  for (int round = 0; round < std::max(contest.rounds, 7); ++round) {
    if (round % 2 == 0) {
      run_ours();
      run_theirs();
    } else {
      run_theirs();
      run_ours();
    }
  }
  return make_figure(std::move(name), median(std::move(ours)), contest.unit, contest.peer,
                     median(std::move(theirs)), Better::kHigher);
}

}  // namespace scatter::bench
