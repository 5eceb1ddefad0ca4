#include "simulator/instrument/instrument_options.h"

#include <charconv>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace scatter::simulator {
namespace {

template <typename T>
struct Choice {
  std::string_view name;
  T value;
};

constexpr Choice<Profile> kProfiles[]{
    {"hs1", Profile::kHs1}, {"fine", Profile::kFine}, {"binned", Profile::kBinned}};
constexpr Choice<CalibrationHeld> kCalibrations[]{{"session", CalibrationHeld::kSession},
                                                  {"stale", CalibrationHeld::kStale},
                                                  {"none", CalibrationHeld::kNone}};
constexpr Choice<References> kReferences[]{{"exact", References::kExact}, {"drawn", References::kDrawn}};
constexpr Choice<ClockMode> kClocks[]{{"virtual", ClockMode::kVirtual}, {"real", ClockMode::kReal}};
constexpr Choice<bool> kModules[]{{"transmission", true}, {"none", false}};

template <typename T, std::size_t N>
Status choose(std::string_view key, std::string_view value, const Choice<T> (&choices)[N], T& out) {
  std::string names;
  for (const Choice<T>& choice : choices) {
    if (choice.name == value) {
      out = choice.value;
      return {};
    }
    names += (names.empty() ? "" : " or ") + std::string(choice.name);
  }
  return fail(ErrorCode::kInvalidArgument,
              fmt::format("simulated instrument: {} is \"{}\", expected {}", key, value, names),
              fmt::format("write {}={}", key, choices[0].name));
}

std::optional<unsigned> hex_digit(char c) {
  if (c >= '0' && c <= '9') {
    return static_cast<unsigned>(c - '0');
  }
  const char lower = static_cast<char>(c | 0x20);
  if (lower >= 'a' && lower <= 'f') {
    return static_cast<unsigned>(lower - 'a' + 10);
  }
  return std::nullopt;
}

Result<std::string> decode_percent(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    const auto high = i + 1 < text.size() ? hex_digit(text[i + 1]) : std::nullopt;
    const auto low = i + 2 < text.size() ? hex_digit(text[i + 2]) : std::nullopt;
    if (!high || !low) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("simulated instrument: \"{}\" has a '%' without two hexadecimal digits", text),
                  "write %25 for a percent sign");
    }
    decoded += static_cast<char>(*high * 16 + *low);
    i += 2;
  }
  return decoded;
}

Status parse_seed(std::string_view value, std::uint64_t& seed) {
  const auto [end, problem] = std::from_chars(value.data(), value.data() + value.size(), seed);
  if (value.empty() || problem != std::errc{} || end != value.data() + value.size()) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("simulated instrument: seed is \"{}\", expected a whole number from 0 to 2^64-1", value),
        "write seed=1");
  }
  return {};
}

Status set_option(std::string_view key, const std::string& value, InstrumentOptions& options) {
  if (key == "sample") {
    options.sample = value;
    return {};
  }
  if (key == "seed") {
    return parse_seed(value, options.seed);
  }
  if (key == "fault") {
    return add_faults(value, options.faults);
  }
  if (key == "profile") {
    return choose(key, value, kProfiles, options.profile);
  }
  if (key == "calibration") {
    return choose(key, value, kCalibrations, options.calibration);
  }
  if (key == "references") {
    return choose(key, value, kReferences, options.references);
  }
  if (key == "clock") {
    return choose(key, value, kClocks, options.clock);
  }
  if (key == "module") {
    return choose(key, value, kModules, options.transmission_module);
  }
  if (key == "flash") {
    options.flash_file = value;
    return {};
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("simulated instrument: unknown key \"{}\"", key),
              "use sample, seed, fault, profile, calibration, references, clock, module or flash, joined by "
              "'&' (in a shell put the whole URI in quotes)");
}

}  // namespace

Result<InstrumentOptions> parse_instrument_options(std::string_view query, InstrumentOptions defaults) {
  InstrumentOptions options = std::move(defaults);
  if (query.starts_with('?')) {
    query.remove_prefix(1);
  }
  while (!query.empty()) {
    const std::size_t end = query.find('&');
    const std::string_view pair = query.substr(0, end);
    query.remove_prefix(end == std::string_view::npos ? query.size() : end + 1);
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("simulated instrument: \"{}\" is not of the form key=value", pair),
                  "write for example sim:?sample=lambertian:0.5&seed=1");
    }
    const Result<std::string> value = decode_percent(pair.substr(equals + 1));
    if (!value) {
      return std::unexpected(value.error());
    }
    if (Status set = set_option(pair.substr(0, equals), *value, options); !set) {
      return std::unexpected(std::move(set.error()));
    }
  }
  return options;
}

}  // namespace scatter::simulator
