#include "host_sdk/reflectance/estimators/chain_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace scatter::reflectance {
namespace {

/// Chains nest; nobody needs more, and a runaway text must not exhaust the stack.
constexpr std::size_t kMostLinks = 16;

std::unexpected<Error> bad(const std::string& what, const std::string& remedy) {
  return fail(ErrorCode::kInvalidArgument, "chain: " + what, remedy);
}

}  // namespace

Status LinkText::add(std::string_view key, std::string_view value) {
  if (std::ranges::any_of(values_, [&](const auto& held) { return held.first == key; })) {
    return bad(fmt::format("{}: {} is given twice", name_, key), "give it once");
  }
  values_.emplace_back(key, value);
  return {};
}

std::optional<std::string> LinkText::take(std::string_view key) {
  known_ += fmt::format("{}{}", known_.empty() ? "" : ", ", key);
  const auto held = std::ranges::find_if(values_, [&](const auto& v) { return v.first == key; });
  if (held == values_.end()) {
    return std::nullopt;
  }
  std::string value = std::move(held->second);
  values_.erase(held);
  return value;
}

Result<std::optional<double>> LinkText::number(std::string_view key) {
  const std::optional<std::string> text = take(key);
  if (!text) {
    return std::optional<double>();
  }
  double value = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (error != std::errc() || end != text->data() + text->size() || !std::isfinite(value)) {
    return bad(fmt::format("{}: {} is \"{}\", expected a number", name_, key, *text), "give a number");
  }
  return std::optional<double>(value);
}

Result<double> LinkText::number(std::string_view key, double fallback) {
  const Result<std::optional<double>> value = number(key);
  if (!value) {
    return std::unexpected(value.error());
  }
  return value->value_or(fallback);
}

Result<std::size_t> LinkText::count(std::string_view key, std::size_t fallback) {
  const std::optional<std::string> text = take(key);
  if (!text) {
    return fallback;
  }
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (error != std::errc() || end != text->data() + text->size()) {
    return bad(fmt::format("{}: {} is \"{}\", expected a whole number", name_, key, *text),
               "give a whole number");
  }
  return value;
}

Result<std::string> LinkText::word(std::string_view key, const std::vector<std::string>& words) {
  const std::optional<std::string> text = take(key);
  if (!text) {
    return words.front();
  }
  if (std::ranges::find(words, *text) == words.end()) {
    return bad(fmt::format("{}: {} is \"{}\", expected one of {}", name_, key, *text, fmt::join(words, ", ")),
               "give one of the words");
  }
  return *text;
}

Status LinkText::done() const {
  if (values_.empty()) {
    return {};
  }
  return bad(fmt::format("{} has no parameter {}", name_, values_.front().first),
             known_.empty() ? fmt::format("give {} without parameters", name_)
                            : fmt::format("{} has the parameters {}", name_, known_));
}

Result<std::vector<LinkText>> parse_chain_text(std::string_view text) {
  std::vector<LinkText> links;
  if (text.empty()) {
    return links;
  }
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    std::string_view part = text.substr(at, comma - at);
    at = comma + 1;
    const std::size_t equals = part.find('=');
    const std::size_t colon = part.find(':');
    if (part.empty()) {
      return bad(fmt::format("\"{}\" has an empty part", text), "write links and parameters between commas");
    }
    if (equals == std::string_view::npos || colon < equals) {
      const std::string_view name = part.substr(0, colon);
      if (name.empty()) {
        return bad(fmt::format("\"{}\" has no name before the colon", part), "write name:key=value");
      }
      if (links.size() == kMostLinks) {
        return bad(fmt::format("more than {} links", kMostLinks), "shorten the chain");
      }
      links.emplace_back(name);
      if (colon == std::string_view::npos) {
        continue;
      }
      part = part.substr(colon + 1);
    }
    const std::size_t sign = part.find('=');
    if (sign == std::string_view::npos || sign == 0 || sign + 1 == part.size()) {
      return bad(fmt::format("\"{}\" is no parameter, expected key=value", part), "write name:key=value");
    }
    if (links.empty()) {
      return bad(fmt::format("parameter \"{}\" comes before any link", part), "name the link first");
    }
    if (Status status = links.back().add(part.substr(0, sign), part.substr(sign + 1)); !status) {
      return std::unexpected(status.error());
    }
  }
  return links;
}

}  // namespace scatter::reflectance
