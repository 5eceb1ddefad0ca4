#include "simulator/faults/fault_plan.h"

#include <charconv>
#include <string>
#include <system_error>

#include <fmt/format.h>

namespace scatter::simulator {
namespace {

constexpr std::string_view kRemedy =
    "use one of drop:RATE, corrupt:RATE, duplicate:RATE, reorder:RATE, truncate:RATE, garbage:RATE, "
    "stall:AT_BYTE[:MS], disconnect:AT_BYTE, usb_stall:RATE, usb_short:RATE, usb_babble:RATE, readout:RATE, "
    "led:INDEX, reset:AT_FRAME, joined by '+'";

std::unexpected<Error> refuse(std::string what) {
  return fail(ErrorCode::kInvalidArgument, std::move(what), std::string(kRemedy));
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t at = text.find(separator);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) {
      return parts;
    }
    text.remove_prefix(at + 1);
  }
}

template <typename T>
std::optional<T> number(std::string_view text) {
  T value{};
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc{} || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

/// The member that a rate's name sets; null for other names.
double LinkRates::* rate_member(std::string_view name) {
  struct Row {
    std::string_view name;
    double LinkRates::* member;
  };
  static constexpr std::array kRows{
      Row{"drop", &LinkRates::drop},           Row{"corrupt", &LinkRates::corrupt},
      Row{"duplicate", &LinkRates::duplicate}, Row{"reorder", &LinkRates::reorder},
      Row{"truncate", &LinkRates::truncate},   Row{"garbage", &LinkRates::garbage},
  };
  for (const Row& row : kRows) {
    if (row.name == name) {
      return row.member;
    }
  }
  return nullptr;
}

/// The chance that has no direction and that this name sets; null for other names.
double* directionless_rate(std::string_view name, FaultPlan& plan) {
  if (name == "readout") {
    return &plan.readout;
  }
  if (name == "usb_stall") {
    return &plan.usb.stall;
  }
  if (name == "usb_short") {
    return &plan.usb.short_read;
  }
  return name == "usb_babble" ? &plan.usb.babble : nullptr;
}

struct Item {
  std::string_view text;
  std::string_view name;
  std::vector<std::string_view> values;
  std::optional<Direction> direction;
};

Result<double> parse_rate(const Item& item) {
  const std::optional<double> rate = number<double>(item.values[0]);
  if (!rate || !(*rate >= 0 && *rate <= 1)) {
    return refuse(fmt::format("fault \"{}\": the rate is \"{}\", expected a number from 0 to 1", item.text,
                              item.values[0]));
  }
  return *rate;
}

Status add_one(const Item& item, FaultPlan& plan) {
  const bool is_stall = item.name == "stall";
  if (item.values.size() > (is_stall ? 2U : 1U)) {
    return refuse(fmt::format("fault \"{}\" has {} values, expected {}", item.text, item.values.size(),
                              is_stall ? "1 or 2" : "1"));
  }
  if (double LinkRates::* const member = rate_member(item.name)) {
    const Result<double> rate = parse_rate(item);
    if (!rate) {
      return std::unexpected(rate.error());
    }
    for (const Direction direction : {Direction::kToHost, Direction::kToDevice}) {
      if (item.direction.value_or(direction) == direction) {
        plan.link[static_cast<std::size_t>(direction)].*member = *rate;
      }
    }
    return {};
  }
  if (is_stall || item.name == "disconnect") {
    const std::optional<std::uint64_t> at = number<std::uint64_t>(item.values[0]);
    if (!at) {
      return refuse(fmt::format("fault \"{}\": the position is \"{}\", expected a count of bytes", item.text,
                                item.values[0]));
    }
    const Direction direction = item.direction.value_or(Direction::kToHost);
    if (!is_stall) {
      plan.disconnects.push_back({direction, *at});
      return {};
    }
    Stall stall{direction, *at, std::nullopt};
    if (item.values.size() == 2) {
      const std::optional<std::uint32_t> milliseconds = number<std::uint32_t>(item.values[1]);
      if (!milliseconds) {
        return refuse(fmt::format("fault \"{}\": the time is \"{}\", expected milliseconds", item.text,
                                  item.values[1]));
      }
      stall.duration_us = std::uint64_t{*milliseconds} * 1000;
    }
    plan.stalls.push_back(stall);
    return {};
  }
  double* const single_rate = directionless_rate(item.name, plan);
  if (single_rate == nullptr && item.name != "led" && item.name != "reset") {
    return refuse(fmt::format("unknown fault \"{}\"", item.text));
  }
  if (item.direction) {
    return refuse(fmt::format("fault \"{}\" takes no direction", item.text));
  }
  if (single_rate != nullptr) {
    const Result<double> rate = parse_rate(item);
    if (!rate) {
      return std::unexpected(rate.error());
    }
    *single_rate = *rate;
    return {};
  }
  if (item.name == "led") {
    const std::optional<std::uint8_t> index = number<std::uint8_t>(item.values[0]);
    if (!index) {
      return refuse(fmt::format("fault \"{}\": \"{}\" is not an illumination's index (0 is the first)",
                                item.text, item.values[0]));
    }
    plan.dead_leds.push_back(*index);
    return {};
  }
  const std::optional<std::uint64_t> frame = number<std::uint64_t>(item.values[0]);
  if (!frame || *frame == 0) {
    return refuse(fmt::format("fault \"{}\": \"{}\" is not the number of an exposure (1 is the first)",
                              item.text, item.values[0]));
  }
  plan.reset_at_frame.push_back(*frame);
  return {};
}

}  // namespace

Status add_faults(std::string_view text, FaultPlan& plan) {
  FaultPlan result = plan;
  for (const std::string_view one : split(text, '+')) {
    std::vector<std::string_view> parts = split(one, ':');
    Item item{
        .text = one, .name = parts.front(), .values = {parts.begin() + 1, parts.end()}, .direction = {}};
    if (!item.values.empty() && item.values.back() == "to_host") {
      item.direction = Direction::kToHost;
      item.values.pop_back();
    } else if (!item.values.empty() && item.values.back() == "to_device") {
      item.direction = Direction::kToDevice;
      item.values.pop_back();
    }
    if (item.values.empty()) {
      return refuse(fmt::format("fault \"{}\" has no value", one));
    }
    if (const Status added = add_one(item, result); !added) {
      return added;
    }
  }
  plan = std::move(result);
  return {};
}

}  // namespace scatter::simulator
