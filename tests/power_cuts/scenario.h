// What the enumeration of power cuts tries: a scenario makes trials, a trial is one device under cuts.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "simulator/faults/cut_flash.h"

namespace scatter::power_cuts {

/// One device and all its flash, on one supply. The enumeration turns the power on before act(), recover()
/// and judge(), and arms the cuts. Whatever the firmware keeps in RAM is made when one of these begins and
/// thrown away when it returns.
class Trial {
 public:
  virtual ~Trial() = default;
  /// The same cells and expectations on a supply of its own. Called while the power is off.
  [[nodiscard]] virtual std::unique_ptr<Trial> clone() const = 0;
  [[nodiscard]] virtual simulator::Supply& supply() = 0;
  /// What the scenario does, from power-on until it is done or supply().lost().
  virtual void act() = 0;
  /// The next power-on after a cut: the firmware's recovery and some use; a second cut falls in here.
  virtual void recover() = 0;
  /// Without cuts from here on: "" when every promise was kept, else which one was not. May turn the power
  /// off and on.
  [[nodiscard]] virtual std::string judge() = 0;
};

/// How many points are tried.
struct Thoroughness {
  /// Draws of torn and half-done operations.
  std::uint32_t details = 2;
  /// Draws of unstable cells; 0: twice `details`.
  std::uint32_t unstable = 0;
  /// One pair of cuts in so many is tried, by the pair's own number. 0: none.
  std::uint32_t double_share = 1;
};

/// Threads: begin() is called from several at once.
class Scenario {
 public:
  virtual ~Scenario() = default;
  /// "GROUP:VARIANT:NAME", for example "calibration:4096x64/32:commit"; no other colons.
  [[nodiscard]] virtual std::string name() const = 0;
  /// A device in the scenario's starting state, power off.
  [[nodiscard]] virtual std::unique_ptr<Trial> begin() const = 0;
  [[nodiscard]] virtual Thoroughness thoroughness(bool quick) const = 0;
};

using Scenarios = std::vector<std::unique_ptr<Scenario>>;

/// Each group adds its scenarios; main.cpp calls them all.
void add_calibration_cuts(Scenarios& scenarios);
void add_update_cuts(Scenarios& scenarios);

}  // namespace scatter::power_cuts
