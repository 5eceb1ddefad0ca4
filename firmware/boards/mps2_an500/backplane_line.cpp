#include "firmware/boards/mps2_an500/backplane_line.h"

#include "firmware/backplane/check.h"

namespace scatter::firmware::mps2_an500 {

bool BackplaneLine::send(backplane::Kind kind, std::span<std::byte> bytes, std::size_t payload) noexcept {
  bytes[0] = static_cast<std::byte>(kind);
  bytes[1] = static_cast<std::byte>(payload);
  const std::span<std::byte> whole = bytes.first(kHeadBytes + payload + 1);
  whole.back() = backplane::check_of(whole.first(whole.size() - 1));
  return uart_.write_room() >= whole.size() && uart_.write(whole) == whole.size();
}

std::optional<BackplaneLine::Message> BackplaneLine::receive() noexcept {
  for (;;) {
    const std::size_t payload = held_ < kHeadBytes ? 0 : static_cast<std::size_t>(buffer_[1]);
    if (held_ >= kHeadBytes && payload > backplane::kMaxPayload) {
      ++damaged_;
      held_ = 0;  // The other side speaks another version; what follows is as unknown.
      continue;
    }
    const std::size_t wanted = held_ < kHeadBytes ? kHeadBytes : kHeadBytes + payload + 1;
    const std::size_t got = uart_.read(std::span(buffer_).subspan(held_, wanted - held_));
    held_ += got;
    if (held_ < wanted) {
      return std::nullopt;
    }
    if (wanted == kHeadBytes) {
      continue;
    }
    held_ = 0;
    const std::span<const std::byte> whole = std::span(buffer_).first(wanted);
    if (whole.back() != backplane::check_of(whole.first(wanted - 1))) {
      ++damaged_;
      continue;
    }
    return Message{static_cast<backplane::Kind>(whole[0]), whole.subspan(kHeadBytes, payload)};
  }
}

}  // namespace scatter::firmware::mps2_an500
