// The bytes of the rescue reports. Expected bytes are written down from the tables of SPEC.md section 12.
//
#include <catch2/catch.hpp>

#include "protocol/rescue_report.h"
#include "tests/unit/firmware_usb/descriptor_walk.h"

using namespace scatter::protocol;
using scatter::firmware::fake::Bytes;
using scatter::firmware::fake::bytes;

namespace {

/// `start`, then zeros up to 64.
Bytes padded(std::initializer_list<unsigned> start) {
  Bytes all = bytes(start);
  all.resize(64);
  return all;
}
template <typename T>
Bytes encoded(const T& value) {
  Report report;
  report.fill(std::byte{0xEE});  // Every byte must be written.
  encode(value, report);
  return {report.begin(), report.end()};
}

const Bytes kStatus = padded({1,    1,    2,    3,    3,    0,    0,    0,     // kind, holding, fault, flags
                              0x04, 0x03, 0x02, 0x01, 0x78, 0x56, 0x34, 0x12,  // presses, boots
                              9,    0,    0,    0,    0x0A, 0x01, 0,    0,     // run, exposed
                              0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11,  // uptime
                              0x10, 0x27, 0,    0,                             // worst turn
                              0xA6, 0x8C, 0x04, 0,                             // 298150 mK
                              0xFF, 0xFF, 0xFF, 0xFF});                        // -1 mK

RescueStatus status() {
  return {.run_state = 2,
          .reset_reason = 3,
          .session_open = true,
          .fault_recorded = true,
          .dfu_mode = false,
          .button_presses = 0x01020304,
          .boot_count = 0x12345678,
          .run_id = 9,
          .exposed = 266,
          .worst_poll_us = 10'000,
          .uptime_us = 0x1122334455667788,
          .sensor_mK = 298'150,
          .led_board_mK = -1};
}

}  // namespace

// PROVES: SPEC 12.2
TEST_CASE("A rescue request has the bytes of SPEC 12") {
  const Bytes expected = padded({1, 4, 0x5A, 0, 0x30, 0x01});
  CHECK(encoded(RescueRequest{.command = RescueCommand::kFaultRecord, .tag = 0x5A, .offset = 0x0130}) ==
        expected);
  const auto back = decode_rescue_request(expected);
  REQUIRE(back.has_value());
  CHECK(back->command == RescueCommand::kFaultRecord);
  CHECK(back->tag == 0x5A);
  CHECK(back->offset == 0x0130);
}

// PROVES: SPEC 12.2
TEST_CASE("A rescue answer has the bytes of SPEC 12") {
  RescueAnswer answer{.command = RescueCommand::kFaultRecord,
                      .tag = 7,
                      .status = StatusCode::kOk,
                      .offset = 48,
                      .total = 51,
                      .size = 3};
  answer.bytes[0] = std::byte{0xAA};
  answer.bytes[1] = std::byte{0xBB};
  answer.bytes[2] = std::byte{0xCC};
  answer.bytes[3] = std::byte{0xDD};  // Behind `size`: not sent.
  const Bytes expected = padded({1, 2, 4, 7, 0, 0, 48, 0, 51, 0, 3, 0, 0xAA, 0xBB, 0xCC});
  CHECK(encoded(answer) == expected);
  const auto back = decode_rescue_answer(expected);
  REQUIRE(back.has_value());
  CHECK(back->offset == 48);
  CHECK(back->total == 51);
  CHECK(back->size == 3);
  CHECK(back->bytes[2] == std::byte{0xCC});
  CHECK(back->bytes[3] == std::byte{0});
  const auto refused = decode_rescue_answer(padded({1, 2, 2, 1, 3, 0}));
  REQUIRE(refused.has_value());
  CHECK(refused->status == StatusCode::kFailedPrecondition);
}

// PROVES: SPEC 12.5
TEST_CASE("A rescue status has the bytes of SPEC 12") {
  CHECK(encoded(status()) == kStatus);
  const auto back = decode_rescue_status(kStatus);
  REQUIRE(back.has_value());
  CHECK(back->run_state == 2);
  CHECK(back->reset_reason == 3);
  CHECK(back->session_open);
  CHECK(back->fault_recorded);
  CHECK_FALSE(back->dfu_mode);
  CHECK(back->button_presses == 0x01020304);
  CHECK(back->boot_count == 0x12345678);
  CHECK(back->run_id == 9);
  CHECK(back->exposed == 266);
  CHECK(back->worst_poll_us == 10'000);
  CHECK(back->uptime_us == 0x1122334455667788);
  CHECK(back->sensor_mK == 298'150);
  CHECK(back->led_board_mK == -1);
}

// PROVES: SPEC 12.1
TEST_CASE("Reports of another version or kind, or out of range, are not read") {
  CHECK_FALSE(decode_rescue_request({}).has_value());
  CHECK_FALSE(decode_rescue_request(padded({2, 1})).has_value());
  CHECK_FALSE(decode_rescue_request(padded({1, 0})).has_value());
  CHECK_FALSE(decode_rescue_request(padded({1, 5})).has_value());
  CHECK_FALSE(decode_rescue_answer(kStatus).has_value());
  CHECK_FALSE(decode_rescue_answer(padded({2, 2, 1})).has_value());
  CHECK_FALSE(decode_rescue_answer(padded({1, 2, 5})).has_value());                            // command
  CHECK_FALSE(decode_rescue_answer(padded({1, 2, 1, 0, 17})).has_value());                     // status
  CHECK_FALSE(decode_rescue_answer(padded({1, 2, 4, 0, 0, 0, 0, 0, 60, 0, 49})).has_value());  // size
  CHECK_FALSE(decode_rescue_answer(padded({1, 2, 4, 0, 0, 0, 10, 0, 12, 0, 3})).has_value());  // past total
  CHECK_FALSE(decode_rescue_status(padded({1, 2})).has_value());
  CHECK_FALSE(decode_rescue_status(padded({2, 1})).has_value());
  CHECK_FALSE(decode_rescue_status(padded({1, 1, 3})).has_value());     // run state
  CHECK_FALSE(decode_rescue_status(padded({1, 1, 0, 5})).has_value());  // reset reason
}

// PROVES: SPEC 12.1
TEST_CASE("A short report is read as if zeros followed, a long one is cut") {
  const auto request = decode_rescue_request(bytes({1, 2, 9}));
  REQUIRE(request.has_value());
  CHECK(request->command == RescueCommand::kAbort);
  CHECK(request->tag == 9);
  CHECK(request->offset == 0);
  Bytes longer = kStatus;
  longer.resize(100, std::byte{0xFF});
  const auto status_back = decode_rescue_status(longer);
  REQUIRE(status_back.has_value());
  CHECK(encoded(*status_back) == kStatus);
}

// PROVES: SPEC 12.1
TEST_CASE("Bytes without a meaning yet are ignored") {
  Bytes later = kStatus;
  later[4] |= std::byte{0xF8};
  later[5] = later[6] = later[7] = later[44] = later[63] = std::byte{0xFF};
  const auto back = decode_rescue_status(later);
  REQUIRE(back.has_value());
  CHECK(encoded(*back) == kStatus);
}
