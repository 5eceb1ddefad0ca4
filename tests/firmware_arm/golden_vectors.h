// Rows of the table that golden_table.py makes of the golden vectors.
#pragma once

#include <cstdint>

#include "protocol/frame.h"

namespace scatter::firmware::golden {

/// A stretch of the table's bytes.
struct Piece {
  std::uint32_t at;
  std::uint32_t size;
};
struct CrcVector {
  Piece bytes;
  std::uint32_t crc;
};
struct FrameVector {
  const char* name;
  std::uint16_t message;
  Piece payload;
  Piece frame;
};
struct RejectedVector {
  const char* rule;
  protocol::ParseStatus status;
  Piece bytes;
};
struct PayloadVector {
  const char* rule;
  std::uint16_t message;
  Piece payload;
  Piece canonical;
};
struct SerialVector {
  const char* rule;
  Piece frame;
  Piece line;
};

}  // namespace scatter::firmware::golden
