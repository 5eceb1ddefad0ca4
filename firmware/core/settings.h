// Key-value settings: a closed list of keys. Writable ones are kept in flash by persistent_state.h,
// read-only ones come from the descriptor.
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "protocol/descriptor.h"
#include "protocol/messages.h"

namespace scatter::firmware {

class Settings {
 public:
  using Value = protocol::BoundedString<64>;
  /// "name": what the owner calls the instrument. "location": where it stands. Both empty at first.
  static constexpr std::array<std::string_view, 2> kWritable{"name", "location"};
  /// Text for an unknown key.
  static constexpr std::string_view kKnownKeys =
      "known keys: name, location (writable), serial, product, hardware_revision (read-only)";

  explicit Settings(const protocol::Descriptor& descriptor) noexcept : descriptor_(descriptor) {}

  /// The value and whether it is read-only; nothing for an unknown key.
  [[nodiscard]] std::optional<protocol::KeyValue> get(std::string_view key) const noexcept;
  [[nodiscard]] static bool is_writable(std::string_view key) noexcept;
  /// False for keys that are not writable.
  bool set(std::string_view key, std::string_view value) noexcept;
  [[nodiscard]] const Value& value(std::size_t writable_index) const noexcept {
    return values_[writable_index];
  }

 private:
  const protocol::Descriptor& descriptor_;
  std::array<Value, kWritable.size()> values_{};
};

}  // namespace scatter::firmware
