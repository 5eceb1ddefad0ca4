#include "firmware/core/request_reader.h"

namespace scatter::firmware {

RequestReader::Change RequestReader::follow_link() noexcept {
  const bool connected = link_.connected();
  if (connected == connected_) {
    return Change::kNone;
  }
  connected_ = connected;
  decoder_.reset();
  unread_ = {};
  decoder_has_more_ = false;
  return connected ? Change::kAttached : Change::kDetached;
}

}  // namespace scatter::firmware
