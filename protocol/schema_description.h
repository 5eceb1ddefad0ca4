// Machine-readable description of the wire, and its digest: JSON lines made from the field lists.
//
// First line: {"wire_major":1,"schema_revision":1}. Then one line per status code
//   {"status":"OK","code":0}
// and one per message
//   {"message":"credit","id":8,"direction":"host to device","channel":"event","fields":[
//    {"path":"run_id","type":"u32","unit":"","default":"0","meaning":"..."},...]}   (in one line)
// and per object ("object" in place of "message"). Paths: "a.b" is field b of nested struct a, "a[].b"
// field b of each element of array a. Types: u8..u64, i32, f32, u8[N] (raw), text<=N and T[<=N] (u16
// count, then the elements), struct (the fields follow), bytes (the rest of the payload).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "protocol/bounded.h"
#include "protocol/codec.h"
#include "protocol/descriptor.h"
#include "protocol/message_traits.h"
#include "protocol/messages.h"

namespace scatter::protocol {

/// CRC-32C of the description without meanings: two ends with the same digest encode and decode alike.
/// Computed while compiling.
[[nodiscard]] std::uint32_t schema_digest() noexcept;

enum class Detail : std::uint8_t {
  kWire,  ///< What the digest covers.
  kFull,  ///< With the meaning of each message and field.
};

/// One row of a message's table; nested structs and arrays of structs are followed by their rows.
struct FieldRow {
  BoundedString<96> path;
  BoundedString<24> type;
  std::string_view unit;
  std::string_view meaning;
  BoundedString<24> default_text;  ///< Of scalars outside arrays; empty elsewhere.
};

namespace schema_detail {

template <std::size_t N>
constexpr void append(BoundedString<N>& text, std::string_view more) noexcept {
  for (const char c : more) {
    text.push_back(c);
  }
}

template <std::size_t N>
constexpr void append_number(BoundedString<N>& text, std::uint64_t value) noexcept {
  std::array<char, 20> digits{};
  std::size_t count = 0;
  do {
    digits[count++] = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  while (count > 0) {
    text.push_back(digits[--count]);
  }
}

template <Scalar T>
constexpr std::string_view scalar_name() noexcept {
  if constexpr (std::is_enum_v<T>) {
    return scalar_name<std::underlying_type_t<T>>();
  } else if constexpr (std::is_floating_point_v<T>) {
    return sizeof(T) == 4 ? "f32" : "f64";
  } else if constexpr (std::is_signed_v<T>) {
    return sizeof(T) == 1 ? "i8" : sizeof(T) == 2 ? "i16" : sizeof(T) == 4 ? "i32" : "i64";
  } else {
    return sizeof(T) == 1 ? "u8" : sizeof(T) == 2 ? "u16" : sizeof(T) == 4 ? "u32" : "u64";
  }
}

template <typename T>
constexpr BoundedString<24> type_text() noexcept {
  BoundedString<24> text;
  if constexpr (Scalar<T>) {
    append(text, scalar_name<T>());
  } else if constexpr (codec_detail::kIsRaw<T>) {
    append(text, "u8[");
    append_number(text, std::tuple_size_v<T>);
    append(text, "]");
  } else if constexpr (codec_detail::kIsTail<T>) {
    append(text, "bytes");
  } else if constexpr (codec_detail::Bounded<T>) {
    using Element = codec_detail::Element<T>;
    if constexpr (std::is_same_v<Element, char>) {
      append(text, "text<=");
      append_number(text, T::kCapacity);
    } else {
      append(text, type_text<Element>().str());
      append(text, "[<=");
      append_number(text, T::kCapacity);
      append(text, "]");
    }
  } else {
    append(text, "struct");
  }
  return text;
}

/// Whole numbers in decimal (defaults of the wire are all whole, floats too); a fraction would show as
/// its bits, which is exact as well.
template <Scalar T>
constexpr BoundedString<24> value_text(T value) noexcept {
  BoundedString<24> text;
  if constexpr (std::is_enum_v<T>) {
    text = value_text(static_cast<std::underlying_type_t<T>>(value));
  } else if constexpr (std::is_floating_point_v<T>) {
    static_assert(sizeof(T) == 4);
    const bool whole =
        value > -1e9F && value < 1e9F && static_cast<T>(static_cast<std::int64_t>(value)) == value;
    if (whole) {
      text = value_text(static_cast<std::int64_t>(value));
    } else {
      append(text, "bits ");
      append_number(text, std::bit_cast<std::uint32_t>(value));
    }
  } else if (value < T{0}) {
    append(text, "-");
    append_number(text, std::uint64_t{0} - static_cast<std::uint64_t>(value));
  } else {
    append_number(text, static_cast<std::uint64_t>(value));
  }
  return text;
}

template <Message M, typename Visit>
constexpr void visit_rows(const BoundedString<96>& prefix, bool in_array, const M& defaults, Visit& visit) {
  const auto one = [&]<typename Row>(const Row& row) {
    using T = typename Row::Type;
    FieldRow out;
    out.path = prefix;
    append(out.path, row.name);
    out.type = type_text<T>();
    out.unit = row.unit;
    out.meaning = row.meaning;
    if constexpr (Scalar<T>) {
      if (!in_array) {
        out.default_text = value_text(defaults.*(row.member));
      }
    }
    visit(static_cast<const FieldRow&>(out));
    if constexpr (Message<T>) {
      BoundedString<96> inner = out.path;
      append(inner, ".");
      visit_rows<T>(inner, in_array, defaults.*(row.member), visit);
    } else if constexpr (codec_detail::Bounded<T>) {
      if constexpr (Message<codec_detail::Element<T>>) {
        BoundedString<96> inner = out.path;
        append(inner, "[].");
        visit_rows<codec_detail::Element<T>>(inner, true, {}, visit);
      }
    }
  };
  codec_detail::with_rows<M>([&](const auto&... row) { (one(row), ...); });
}

}  // namespace schema_detail

/// Calls visit(const FieldRow&) for each field of M in the order of the wire. The row lives only during
/// the call.
template <Message M, typename Visit>
constexpr void for_each_row(Visit&& visit) {
  schema_detail::visit_rows<M>({}, false, M{}, visit);
}

/// Writes the description piece by piece to sink(std::string_view). No heap.
template <typename Sink>
constexpr void describe_schema(Sink&& sink, Detail detail) {
  const auto number = [&](std::uint64_t value) {
    BoundedString<24> text;
    schema_detail::append_number(text, value);
    sink(text.str());
  };
  const auto quoted = [&](std::string_view key, std::string_view value) {
    sink("\"");
    sink(key);
    sink("\":\"");
    for (const char& c : value) {
      if (c == '"' || c == '\\') {
        sink("\\");
      }
      sink(std::string_view(&c, 1));
    }
    sink("\"");
  };
  const auto rows = [&]<typename M>() {
    sink(",\"fields\":[");
    bool first = true;
    for_each_row<M>([&](const FieldRow& row) {
      sink(first ? "{" : ",{");
      first = false;
      quoted("path", row.path.str());
      sink(",");
      quoted("type", row.type.str());
      sink(",");
      quoted("unit", row.unit);
      sink(",");
      quoted("default", row.default_text.str());
      if (detail == Detail::kFull) {
        sink(",");
        quoted("meaning", row.meaning);
      }
      sink("}");
    });
    sink("]}\n");
  };

  sink("{\"wire_major\":");
  number(kWireMajor);
  sink(",\"schema_revision\":");
  number(kSchemaRevision);
  sink("}\n");
  for (const StatusInfo& status : kStatusTable) {
    sink("{");
    quoted("status", status.name);
    sink(",\"code\":");
    number(static_cast<std::uint64_t>(status.code));
    if (detail == Detail::kFull) {
      sink(",");
      quoted("remedy", status.remedy);
    }
    sink("}\n");
  }
  for_each_message([&]<typename M>() {
    sink("{");
    quoted("message", M::kName);
    sink(",\"id\":");
    number(static_cast<std::uint64_t>(M::kId));
    sink(",");
    quoted("direction", name_of(direction_of(M::kId)));
    sink(",");
    quoted("channel", name_of(channel_of(M::kId)));
    if (detail == Detail::kFull) {
      sink(",");
      quoted("meaning", M::kMeaning);
    }
    rows.template operator()<M>();
  });
  sink("{");
  quoted("object", "descriptor");
  sink(",\"id\":");
  number(static_cast<std::uint64_t>(ObjectId::kDescriptor));
  rows.template operator()<Descriptor>();
}

}  // namespace scatter::protocol
