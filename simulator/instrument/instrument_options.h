// Which simulated instrument: options, and their text form in `sim:` URIs and `scatter simulate`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/bench/bench.h"
#include "simulator/faults/fault_plan.h"
#include "simulator/instrument/virtual_clock.h"

namespace scatter::simulator {

/// What the device knows of calibrations when the host comes.
enum class CalibrationHeld : std::uint8_t {
  kSession,  ///< Fresh: none yet, but its reference stage lets the host make one at any time.
  kStale,    ///< Like kSession, but every calibration is past its life when it is needed.
  kNone,     ///< None, and no way to make one: no stage, no references delivered.
};

/// How the host reaches the instrument.
enum class Carrier : std::uint8_t {
  kPipe,  ///< Two byte queues, in this process or behind a socket.
  kUsb,   ///< A USB socket: VirtualInstrument::usb().
};

struct InstrumentOptions {
  std::string sample = "lambertian:0.5";  ///< See Sample::make.
  std::uint64_t seed = 1;                 ///< Of the instrument, its noise and its faults.
  FaultPlan faults;
  BenchFaults bench_faults;  ///< Not reachable from text.
  Profile profile = Profile::kHs1;
  CalibrationHeld calibration = CalibrationHeld::kSession;
  References references = References::kExact;
  ClockMode clock = ClockMode::kVirtual;
  bool transmission_module = false;  ///< Mounted anyway when the sample transmits.
  Carrier carrier = Carrier::kPipe;  ///< Not reachable from text: who serves the instrument knows.
  std::filesystem::path flash_file;  ///< Keeps the device's flash between runs; empty: forgotten.
};

/// Options from a query such as "?sample=ggx:alpha=0.2+tilt=1.0@30&seed=7&fault=drop:1e-3".
///
/// Grammar   ['?'] [KEY '=' VALUE ('&' KEY '=' VALUE)*]; "%xx" is decoded, '+' stays '+'. Keys: sample,
///           seed, fault (may be repeated), profile=hs1|fine|binned, calibration=session|stale|none,
///           references=exact|drawn, clock=virtual|real, module=transmission|none, flash=FILE.
/// `defaults` holds what the text leaves out.
/// Errors    kInvalidArgument naming the key, the value found and those expected. The sample's text is
///           checked later, by VirtualInstrument::make.
[[nodiscard]] Result<InstrumentOptions> parse_instrument_options(std::string_view query,
                                                                 InstrumentOptions defaults = {});

}  // namespace scatter::simulator
