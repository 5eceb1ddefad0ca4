#include "firmware/core/settings.h"

namespace scatter::firmware {

std::optional<protocol::KeyValue> Settings::get(std::string_view key) const noexcept {
  protocol::KeyValue found;
  found.key = key;
  for (std::size_t i = 0; i < kWritable.size(); ++i) {
    if (key == kWritable[i]) {
      found.value = values_[i];
      return found;
    }
  }
  found.read_only = 1;
  if (key == "serial") {
    found.value = descriptor_.serial.str();
  } else if (key == "product") {
    found.value = descriptor_.product.str();
  } else if (key == "hardware_revision") {
    found.value = descriptor_.hardware_revision.str();
  } else {
    return std::nullopt;
  }
  return found;
}

bool Settings::is_writable(std::string_view key) noexcept {
  for (const std::string_view known : kWritable) {
    if (key == known) {
      return true;
    }
  }
  return false;
}

bool Settings::set(std::string_view key, std::string_view value) noexcept {
  for (std::size_t i = 0; i < kWritable.size(); ++i) {
    if (key == kWritable[i]) {
      values_[i] = value;
      return true;
    }
  }
  return false;
}

}  // namespace scatter::firmware
