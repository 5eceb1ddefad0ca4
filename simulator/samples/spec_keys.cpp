#include "simulator/samples/spec_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>

namespace scatter::simulator {
namespace {

template <typename Number>
std::optional<Number> parsed(std::string_view text, Number low, Number high) noexcept {
  Number value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc{} || end != text.data() + text.size() || !(value >= low && value <= high)) {
    return std::nullopt;
  }
  return value;
}

bool same_word(std::string_view given, std::string_view name) noexcept {
  return std::ranges::equal(given, name, [](char a, char b) {
    const bool gap = a == '_' || a == '-' || a == ' ';
    return gap ? b == ' ' || b == '-' || b == '_' : a == b;
  });
}

}  // namespace

SpecKeys::SpecKeys(std::string_view spec) : spec_(spec) {
  const std::size_t colon = spec.find(':');
  name_ = spec.substr(0, colon);
  std::string_view rest = colon == std::string_view::npos ? "" : spec.substr(colon + 1);
  while (!rest.empty()) {
    const std::size_t comma = rest.find(',');
    const std::string_view item = rest.substr(0, comma);
    rest.remove_prefix(comma == std::string_view::npos ? rest.size() : comma + 1);
    const std::size_t equals = item.find('=');
    if (equals == std::string_view::npos || equals == 0) {
      reject_text(fmt::format("'{}' is not of the form key=value", item));
      return;
    }
    const std::string_view key = item.substr(0, equals);
    if (find(key) != nullptr) {
      reject_text(fmt::format("{} is given twice", key));
      return;
    }
    items_.push_back({key, item.substr(equals + 1)});
    if (comma != std::string_view::npos && rest.empty()) {
      reject_text("ends with a comma, expected another key=value");
    }
  }
  known_.clear();
}

SpecKeys::Item* SpecKeys::find(std::string_view key) {
  known_.push_back(key);
  const auto item = std::ranges::find(items_, key, &Item::key);
  if (item == items_.end()) {
    return nullptr;
  }
  item->known = true;
  return &*item;
}

void SpecKeys::reject_text(std::string what) {
  if (wrong_.empty()) {
    wrong_ = std::move(what);
  }
}

void SpecKeys::reject(std::string_view key, std::string_view expected) {
  const auto item = std::ranges::find(items_, key, &Item::key);
  reject_text(fmt::format("{} is '{}', expected {}", key, item == items_.end() ? "" : item->value, expected));
}

void SpecKeys::reject(Error error) {
  if (!error_ && wrong_.empty()) {
    error_ = std::move(error);
  }
}

void SpecKeys::number(std::string_view key, double low, double high, double& value) {
  if (const Item* item = find(key)) {
    if (const auto read = parsed(item->value, low, high)) {
      value = *read;
    } else {
      reject(key, fmt::format("{}..{}", low, high));
    }
  }
}

void SpecKeys::whole(std::string_view key, std::uint64_t low, std::uint64_t high, std::uint64_t& value) {
  if (const Item* item = find(key)) {
    if (const auto read = parsed(item->value, low, high)) {
      value = *read;
    } else {
      reject(key, fmt::format("a whole number {}..{}", low, high));
    }
  }
}

void SpecKeys::flag(std::string_view key, bool& value) {
  std::size_t chosen = value ? 1 : 0;
  if (const Item* item = find(key); item != nullptr && (item->value == "0" || item->value == "1")) {
    value = item->value == "1";
    return;
  }
  choice(key, {"no", "yes"}, chosen);
  value = chosen == 1;
}

void SpecKeys::choice(std::string_view key, std::initializer_list<std::string_view> names,
                      std::size_t& value) {
  const Item* item = find(key);
  if (item == nullptr) {
    return;
  }
  const auto* const name =
      std::ranges::find_if(names, [&](std::string_view n) { return same_word(item->value, n); });
  if (name == names.end()) {
    reject(key, fmt::format("one of {}", fmt::join(names, ", ")));
    return;
  }
  value = static_cast<std::size_t>(name - names.begin());
}

std::optional<std::string_view> SpecKeys::text(std::string_view key) {
  const Item* item = find(key);
  return item == nullptr ? std::nullopt : std::optional(item->value);
}

std::string SpecKeys::remedy() const {
  std::vector<std::string_view> keys = known_;
  std::ranges::sort(keys);
  const auto repeated = std::ranges::unique(keys);
  keys.erase(repeated.begin(), repeated.end());
  return fmt::format("write {}:key=value,key=value; keys are {}", name_, fmt::join(keys, ", "));
}

Status SpecKeys::finish() const {
  std::string wrong = wrong_;
  if (wrong.empty() && error_) {
    return std::unexpected(*error_);
  }
  for (const Item& item : items_) {
    if (wrong.empty() && !item.known) {
      wrong = fmt::format("unknown key '{}'", item.key);
    }
  }
  if (wrong.empty()) {
    return {};
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("sample '{}': {}", spec_, wrong), remedy());
}

}  // namespace scatter::simulator
