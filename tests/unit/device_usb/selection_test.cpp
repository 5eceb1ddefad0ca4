#include <catch2/catch.hpp>

#include "host_sdk/device/usb/context.h"
#include "host_sdk/device/usb/selection.h"

namespace scatter::device::usb {
namespace {

BusEntry instrument(const std::string& port, const std::string& serial) {
  BusEntry out;
  out.port = port;
  out.serial = serial;
  out.readable = out.ours = true;
  return out;
}

Result<BusEntry> choose(const std::vector<BusEntry>& there, const std::string& uri) {
  const auto wanted = read_selector(*parse_uri(uri));
  REQUIRE(wanted);
  return select(there, *wanted);
}

TEST_CASE("An instrument is named by nothing, by its serial number or by its port") {
  const std::vector<BusEntry> two = {instrument("1-1", "A"), instrument("1-2", "B")};
  CHECK(choose({two[0]}, "usb:")->serial == "A");
  CHECK(choose(two, "usb:serial=B")->port == "1-2");
  CHECK(choose(two, "usb:port=1-1")->serial == "A");
  CHECK(uri_for(two[1]) == "usb:serial=B");
  CHECK(uri_for(instrument("1-3", "")) == "usb:port=1-3");
}

TEST_CASE("Unknown keys and empty values are refused with how to write it") {
  for (const char* bad : {"usb:sereal=1", "usb:serial=", "usb:A", "usb:port=", "usb:serial=1?x=2"}) {
    const auto read = read_selector(*parse_uri(bad));
    REQUIRE_FALSE(read);
    CHECK(read.error().code == ErrorCode::kInvalidArgument);
    CHECK(read.error().remedy.find("usb:serial=SC42") != std::string::npos);
  }
}

TEST_CASE("Several and none named, or a name that is not there: those there are listed") {
  const std::vector<BusEntry> two = {instrument("1-1", "A"), instrument("1-2", "B")};
  const auto several = choose(two, "usb:");
  REQUIRE_FALSE(several);
  CHECK(several.error().code == ErrorCode::kInvalidArgument);
  CHECK(several.error().what.find("usb:serial=A, usb:serial=B") != std::string::npos);
  const auto missing = choose(two, "usb:serial=C");
  REQUIRE_FALSE(missing);
  CHECK(missing.error().code == ErrorCode::kNotFound);
  CHECK(missing.error().what.find("usb:serial=A, usb:serial=B") != std::string::npos);
  CHECK(choose({}, "usb:").error().code == ErrorCode::kNotFound);
  const auto twins = choose({instrument("1-1", "A"), instrument("1-2", "A")}, "usb:serial=A");
  REQUIRE_FALSE(twins);
  CHECK(twins.error().what.find("usb:port=1-1, usb:port=1-2") != std::string::npos);
}

TEST_CASE("Strangers and devices in DFU mode are passed over, and told apart when nothing else is there") {
  BusEntry stranger = instrument("1-4", "X");
  stranger.ours = false;
  stranger.product = "Thermostat";
  BusEntry waiting = instrument("1-5", "Y");
  waiting.dfu_mode = true;
  BusEntry garbled = stranger;
  garbled.readable = false;
  CHECK(choose({stranger, waiting, garbled, instrument("1-1", "A")}, "usb:")->serial == "A");
  for (const auto& [entry, word] :
       {std::pair(stranger, "Thermostat"), std::pair(waiting, "DFU"), std::pair(garbled, "descriptors")}) {
    const auto refused = choose({entry}, "usb:");
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code == ErrorCode::kFailedPrecondition);
    CHECK(refused.error().what.find(word) != std::string::npos);
  }
}

TEST_CASE("Who holds it is named, and the program that asks only when it has it open beside the attempt") {
  const BusEntry entry = instrument("1-1", "A");
  const Holder asking{.process_id = 7, .program = "scatter", .files = 1};
  const Holder twice{.process_id = 7, .program = "scatter", .files = 2};
  const Holder other{.process_id = 8, .program = "lab", .files = 1};
  const auto what = [&](std::vector<Holder> holders) { return busy_error(entry, holders, 7).what; };
  CHECK(what({}) == "instrument 'A' at USB port 1-1 is in use by another program");
  CHECK(what({asking}) == what({}));
  CHECK(what({asking, other}) == "instrument 'A' at USB port 1-1 is in use by lab (8)");
  CHECK(what({twice}) == "instrument 'A' at USB port 1-1: this program has it open already");
  CHECK(what({twice, other}).find("lab (8); this program has it open, too") != std::string::npos);
  CHECK(busy_error(entry, std::vector{twice}, 7).remedy.find("destroy it first") != std::string::npos);
}

TEST_CASE("A number of transfers out of range is refused") {
  for (const int transfers : {0, 15, 65}) {
    const auto context = Context::make({.transfers = transfers});
    REQUIRE_FALSE(context);
    CHECK((context.error().code == ErrorCode::kInvalidArgument ||
           context.error().code == ErrorCode::kUnimplemented));
  }
}

}  // namespace
}  // namespace scatter::device::usb
