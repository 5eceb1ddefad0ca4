// Benchmarks: ours against a peer, run in turns in one process, medians of rounds.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace scatter::bench {

/// One line of the table and one entry of the JSON list.
struct Figure {
  std::string name;         ///< "crc.throughput".
  double value = 0.0;       ///< Ours, in `unit`.
  std::string unit;         ///< "MB/s", "s", "MB", ...; 1 MB = 1e6 bytes.
  std::string peer;         ///< Whom we compare with: "memcpy", a library, a published figure.
  double peer_value = 0.0;  ///< The peer's, in the same unit.
  double ratio = 0.0;       ///< Above 1 means that ours is better, whatever the unit.
};

enum class Better { kHigher, kLower };

/// A figure from two values that were measured elsewhere; computes the ratio.
[[nodiscard]] Figure make_figure(std::string name, double value, std::string unit, std::string peer,
                                 double peer_value, Better better);

/// Two ways to do the same work.
struct Contest {
  std::string unit;              ///< Of `work` per second: "MB/s", "messages/s".
  double work = 0.0;             ///< Done by one call, in the unit's numerator.
  std::function<void()> ours;    ///< One call; must leave its result to keep().
  std::string peer;              ///< Name of the other way.
  std::function<void()> theirs;  ///< One call doing the same amount of work.
  double round_seconds = 0.03;   ///< Least length of one round.
  int rounds = 9;                ///< Odd, at least 7.
};

/// Runs both in turns (ours, theirs, theirs, ours, ...), so that a change of clock speed or of the
/// machine's load meets both alike; each value is the median over the rounds.
[[nodiscard]] Figure run_contest(std::string name, const Contest& contest);

/// Processor time of one call in this thread [s]: what else the machine does counts little. For work of
/// seconds, which run_contest would repeat too often.
[[nodiscard]] double cpu_seconds_of(const std::function<void()>& call);

/// Upper median; not of none.
[[nodiscard]] double median(std::vector<double> values);

/// A benchmark registers itself: `const Benchmark kCrc{"crc.throughput", [] { ...return figures; }};`
/// at namespace scope of a source file of scatter_bench. The function runs only when asked for and
/// names its figures `name` or `name.something`. An empty list means that it could not run here
/// (say why on stderr).
class Benchmark {
 public:
  Benchmark(std::string name, std::function<std::vector<Figure>()> run);
};

/// Makes the compiler believe that `value` is used and memory is read.
template <typename T>
inline void keep(const T& value) {
  asm volatile("" : : "r,m"(value) : "memory");
}

}  // namespace scatter::bench
