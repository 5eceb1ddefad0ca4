#include <catch2/catch.hpp>

#include "tools/scatter/firmware_description.h"

namespace scatter::cli {

// PROVES: Armv7-M Architecture Reference Manual, B3.2.15 and B3.2.16: positions of the bits.
TEST_CASE("Fault status registers are told in words") {
  using Words = std::vector<std::string>;
  CHECK(fault_reasons(0, 0).empty());
  CHECK(fault_reasons(0x0200'0000, 0x4000'0000) == Words{"division by zero"});
  CHECK(fault_reasons(0x0001'0000, 0) == Words{"undefined instruction"});
  CHECK(fault_reasons(0x0000'0082, 0) == Words{"forbidden memory accessed"});   // DACCVIOL, MMARVALID
  CHECK(fault_reasons(0x0000'8200, 0) == Words{"bus fault on a data access"});  // PRECISERR, BFARVALID
  CHECK(fault_reasons(0x0000'0010, 0)[0].find("stack overflow") != std::string::npos);  // MSTKERR
  CHECK(fault_reasons(0, 0x0000'0002) == Words{"vector table cannot be read"});
  CHECK(fault_reasons(0x0102'0000, 0) == Words{"invalid processor state", "unaligned access"});
}

TEST_CASE("A crash is told with its kind, place, time and firmware") {
  protocol::FaultRecord record;
  CHECK(words(record) == "none since power-on");
  CHECK(to_json(record).is_null());
  record.present = 1;
  record.reason = 3;
  record.exception = 4;
  record.boot_count = 12;
  record.uptime_us = 3'250'000;
  record.pc = 0x6080'1234;
  record.lr = 0x6080'0F01;
  record.fault_status = 0x82;
  record.fault_address = 0x10;
  record.build_id = "openscatter 2.0.0";
  CHECK(words(record) ==
        "forbidden memory accessed, at address 0x00000010; pc 0x60801234, lr 0x60800f01, 3.250 s after boot "
        "12, in "
        "openscatter 2.0.0");
  CHECK(to_json(record)["cfsr"] == "0x00000082");
  CHECK(to_json(record)["reasons"][0] == "forbidden memory accessed");
  record.reason = 2;
  CHECK_THAT(words(record), Catch::StartsWith("the main loop hung (watchdog)"));
}

}  // namespace scatter::cli
