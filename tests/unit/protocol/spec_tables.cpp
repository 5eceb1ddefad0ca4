#include "tests/unit/protocol/spec_tables.h"

#include <algorithm>
#include <cstdio>
#include <sstream>
#include <tuple>

#include "protocol/descriptor.h"
#include "protocol/endian.h"
#include "protocol/frame.h"
#include "protocol/schema_description.h"

namespace scatter::protocol::test {
namespace {

std::string hex(unsigned number) {
  char text[16];
  std::snprintf(text, sizeof text, "0x%04X", number);
  return text;
}

/// Offset and size of each header field as write_frame places it: written all ones against all zeros.
std::string header_table() {
  struct Row {
    const char* name;
    void (*set)(FrameHeader&);
    const char* meaning;
  };
  const Row rows[] = {
      {"wire major", [](FrameHeader& h) { h.wire_major = 0xFF; }, "1"},
      {"channel", [](FrameHeader& h) { h.channel = static_cast<Channel>(0xFF); },
       "0 control, 1 event, 2 stream, 3 transfer"},
      {"incompatible flags", [](FrameHeader& h) { h.incompatible_flags = 0xFF; },
       "unknown bit: refuse (rule 1.5)"},
      {"compatible flags", [](FrameHeader& h) { h.compatible_flags = 0xFF; },
       "unknown bit: ignore (rule 1.6)"},
      {"message id", [](FrameHeader& h) { h.message = 0xFFFF; }, "section 9"},
      {"payload length", nullptr, "bytes; at most 16384, on serial lines 1024"},
      {"sequence", [](FrameHeader& h) { h.sequence = 0xFFFFFFFF; }, "per channel and direction, wraps"},
      {"session", [](FrameHeader& h) { h.session = 0xFFFF; }, "nonce of the HELLO in force"},
      {"correlation", [](FrameHeader& h) { h.correlation = 0xFFFF; }, "request id, 0 = none"},
  };
  FrameHeader zero;
  zero.wire_major = 0;
  std::byte blank[kMaxFrameBytes];
  std::ignore = finish_frame(blank, zero, 0);
  std::ostringstream out;
  out << "| offset | size | field | meaning |\n|---:|---:|---|---|\n";
  out << "| 0 | 2 | magic | " << hex(kMagic) << " (bytes A7 5C) |\n";
  for (const Row& row : rows) {
    std::byte bytes[kMaxFrameBytes];
    FrameHeader header = zero;
    std::size_t first = kHeaderBytes;
    std::size_t size = 0;
    if (row.set != nullptr) {
      row.set(header);
      std::ignore = finish_frame(bytes, header, 0);
      for (std::size_t i = 0; i < 20; ++i) {
        if (bytes[i] != blank[i]) {
          first = std::min(first, i);
          ++size;
        }
      }
    } else {
      // The length cannot be all ones: find where the value 0x1234 stands.
      std::ignore = finish_frame(bytes, header, 0x1234);
      for (std::size_t i = 2; i < 20; ++i) {
        if (load_le<std::uint16_t>(bytes + i) == 0x1234) {
          first = i;
          size = sizeof(FrameHeader::payload_length);
        }
      }
    }
    out << "| " << first << " | " << size << " | " << row.name << " | " << row.meaning << " |\n";
  }
  out << "| 20 | 4 | header CRC | CRC-32C of bytes 0 to 19 |\n";
  out << "| " << kHeaderBytes << " | n | payload | section 4 |\n";
  out << "| " << kHeaderBytes << " + n | " << kTrailerBytes << " | payload CRC | CRC-32C of the payload |\n";
  return out.str();
}

std::string status_table() {
  std::ostringstream out;
  out << "| code | name | remedy |\n|---:|---|---|\n";
  for (const StatusInfo& status : kStatusTable) {
    out << "| " << static_cast<unsigned>(status.code) << " | " << status.name << " | " << status.remedy
        << " |\n";
  }
  return out.str();
}

std::string message_table() {
  std::ostringstream out;
  out << "| id | message | direction | channel | reply | bytes | meaning |\n|---|---|---|---|---|---|---|\n";
  for_each_message([&]<typename M>() {
    out << "| " << hex(static_cast<unsigned>(M::kId)) << " | " << M::kName << " | "
        << name_of(direction_of(M::kId)) << " | " << name_of(channel_of(M::kId)) << " | "
        << (is_request(M::kId) ? name_of(reply_of(M::kId)) : std::string_view("-")) << " | "
        << min_encoded_size<M>();
    if (max_encoded_size<M>() != min_encoded_size<M>()) {
      out << " to " << max_encoded_size<M>();
    }
    out << (has_tail<M>() ? " + data" : "") << " | " << M::kMeaning << " |\n";
  });
  return out.str();
}

template <Message M>
void field_table(std::ostream& out, std::string_view title) {
  out << "\n### " << title << "\n\n";
  bool first = true;
  for_each_row<M>([&](const FieldRow& row) {
    if (first) {
      out << "| field | type | unit | default | meaning |\n|---|---|---|---:|---|\n";
      first = false;
    }
    out << "| " << row.path.str() << " | " << row.type.str() << " | " << row.unit << " | "
        << row.default_text.str() << " | " << row.meaning << " |\n";
  });
  if (first) {
    out << "No fields.\n";
  }
}

std::string field_tables() {
  std::ostringstream out;
  for_each_message([&]<typename M>() {
    field_table<M>(out, std::string(M::kName) + " (" + hex(static_cast<unsigned>(M::kId)) + ")");
  });
  return out.str();
}

std::string object_tables() {
  std::ostringstream out;
  field_table<Descriptor>(
      out, "descriptor (object " + std::to_string(static_cast<int>(ObjectId::kDescriptor)) + ")");
  return out.str();
}

std::string table_named(const std::string& name) {
  if (name == "header") {
    return header_table();
  }
  if (name == "status") {
    return status_table();
  }
  if (name == "messages") {
    return message_table();
  }
  if (name == "fields") {
    return field_tables();
  }
  if (name == "objects") {
    return object_tables();
  }
  return "no such table: " + name + "\n";
}

}  // namespace

std::string with_fresh_tables(const std::string& spec) {
  constexpr std::string_view kBegin = "<!-- table ";
  constexpr std::string_view kEnd = "<!-- end -->";
  std::istringstream in(spec);
  std::string out;
  bool inside = false;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(kEnd)) {
      inside = false;
    }
    if (!inside) {
      out += line + "\n";
    }
    if (line.starts_with(kBegin)) {
      inside = true;
      out += table_named(line.substr(kBegin.size(), line.find(" -->") - kBegin.size()));
    }
  }
  return out;
}

}  // namespace scatter::protocol::test
