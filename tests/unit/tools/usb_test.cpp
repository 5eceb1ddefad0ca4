// PROVES: issue 6: `scatter list` and `scatter doctor`, as a user sees them.
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "tests/unit/device_usb_diagnosis/made_up_system.h"
#include "tests/unit/tools/command.h"

using nlohmann::json;

TEST_CASE("list shows each USB instrument with what a person and a machine need to choose one") {
  MadeUpSystem system;
  const MadeUpDevice free;
  MadeUpDevice held;
  held.port = "1-2";
  held.address = 8;
  held.serial = "SC43";
  held.speed = "12";
  system.plug_in(free);
  system.plug_in(held);
  system.hold(held, 4321, "somebody");
  const auto run = scatter({"list", "--json", "--root", system.path()});
  REQUIRE(run.status == 0);
  const auto devices = json::parse(run.out)["devices"];
  REQUIRE(devices.size() == 2);
  CHECK(devices[0]["uri"] == "usb:serial=SC42");
  CHECK(devices[0]["state"] == "free");
  CHECK(devices[0]["product"] == "HS-1");
  CHECK(devices[0]["speed_mbps"] == 480);
  CHECK(devices[0]["slow"] == false);
  CHECK(devices[0]["firmware"] == "1.2.3");
  CHECK(devices[1]["state"] == "in use");
  CHECK(devices[1]["slow"] == true);
  CHECK(devices[1]["holders"] == json::array({{{"process_id", 4321}, {"program", "somebody"}}}));
  const auto text = scatter({"list", "--root", system.path()});
  REQUIRE(text.status == 0);
  for (const char* word : {"usb:serial=SC42", "free", "480 Mb/s", "firmware 1.2.3", "by somebody (4321)"}) {
    INFO(word);
    CHECK(text.out.find(word) != std::string::npos);
  }
}

TEST_CASE("list without instruments names doctor, and is no failure") {
  const MadeUpSystem system;
  const auto run = scatter({"list", "--root", system.path()});
  CHECK(run.status == 0);
  CHECK(run.out.find("scatter doctor") != std::string::npos);
}

TEST_CASE("doctor is done when no problem is left, and has failed while one is") {
  MadeUpSystem system;
  system.plug_in({});
  const auto healthy = scatter({"doctor", "--root", system.path(), "--json"});
  INFO(healthy.out);
  CHECK(healthy.status == 0);
  CHECK(json::parse(healthy.out)["problems"] == 0);
  system.remove("usr/lib/udev/rules.d");
  const auto ill = scatter({"doctor", "--root", system.path(), "--json"});
  CHECK(ill.status == 1);
  const auto answer = json::parse(ill.out);
  CHECK(answer["problems"] == 1);
  int problems = 0;
  for (const auto& finding : answer["findings"]) {
    if (finding["verdict"] == "PROBLEM") {
      ++problems;
      CHECK(finding["check"] == "udev rule");
      CHECK(finding["harmless"] == true);
      CHECK(finding["command"].get<std::string>().find("doctor --udev-rule |") != std::string::npos);
    }
  }
  CHECK(problems == 1);
  const auto text = scatter({"doctor", "--root", system.path()});
  CHECK(text.status == 1);
  CHECK(text.out.find("/etc/udev/rules.d/60-openscatter.rules") != std::string::npos);
  CHECK(text.out.find("1 problem, 0 warnings") != std::string::npos);
}

TEST_CASE("doctor --udev-rule prints the rule that packages install, to the byte") {
  const auto run = scatter({"doctor", "--udev-rule"});
  CHECK(run.status == 0);
  CHECK(run.out == contents("tools/packaging/udev/60-openscatter.rules"));
}

TEST_CASE("doctor changes nothing of another system, and asks for --fix before --yes means anything") {
  const MadeUpSystem system;
  CHECK(scatter({"doctor", "--root", system.path(), "--fix"}).status == 1);
  CHECK(scatter({"doctor", "--yes"}).status == 2);
}

TEST_CASE("rescue and --on-button want an instrument on USB") {
  const Scratch folder;
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"rescue", "tcp:127.0.0.1:7000", "status"},
        std::vector<std::string>{"rescue", "usb:colour=red", "abort"},
        std::vector<std::string>{"measure", "sim:", "--on-button", "-o", folder / "out"}}) {
    const auto run = scatter(arguments);
    INFO(run.err);
    CHECK(run.status == 1);
    CHECK(run.err.find("names no instrument on USB") != std::string::npos);
    CHECK(run.err.find("remedy: ") != std::string::npos);
  }
  CHECK(scatter({"rescue", "SC42", "dance"}).status == 2);
}
