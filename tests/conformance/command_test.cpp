// scatter conform and scatter selftest as a user runs them.
#include <catch2/catch.hpp>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/unit/tools/command.h"

using Json = nlohmann::json;

TEST_CASE("scatter conform passes the simulated instrument and gives every figure to machines") {
  const Finished finished = scatter({"conform", "sim:?seed=2", "--json"});
  REQUIRE(finished.status == 0);
  const Json answer = Json::parse(finished.out);
  CHECK(answer["conforms"] == true);
  CHECK(answer["failed"] == 0);
  CHECK(answer["skipped"] == 2);  // The checks that write.
  for (const Json& check : answer["checks"]) {
    CHECK_FALSE(check["rule"].get<std::string>().empty());
  }
}

TEST_CASE(
    "scatter conform --only runs what is named, and an unknown name is refused with the way to the list") {
  const Finished one = scatter({"conform", "sim:", "--only", "hello", "--only", "window"});
  CHECK(one.status == 0);
  CHECK(one.out.find("2 passed, 0 failed") != std::string::npos);
  const Finished none = scatter({"conform", "sim:", "--only", "helo"});
  CHECK(none.status == 1);
  CHECK(none.err.find("'helo'") != std::string::npos);
  CHECK(none.err.find("--list") != std::string::npos);
}

TEST_CASE("scatter conform fails with status 1 on an instrument that breaks a rule, and says where to look") {
  // Dead LEDs and lost frames are what the simulator can break by its URI.
  const Finished finished = scatter({"conform", "sim:?fault=drop:0.2", "--only", "run-completed"});
  CHECK(finished.status == 1);
  CHECK(finished.out.find("FAILED") != std::string::npos);
  CHECK(finished.out.find("look at:") != std::string::npos);
}

TEST_CASE("scatter conform --list names every check with its rule, and a recording is no device") {
  const Finished listed = scatter({"conform", "--list", "--json"});
  REQUIRE(listed.status == 0);
  CHECK(Json::parse(listed.out)["checks"].size() >= 25);
  const Finished replay = scatter({"conform", "replay:none.scat"});
  CHECK(replay.status == 1);
  CHECK(replay.err.find("recording") != std::string::npos);
  CHECK(scatter({"conform"}).status == 1);
}

TEST_CASE("scatter selftest checks every pixel of the pattern and shows the ledger of a lossy link") {
  const Finished good = scatter({"selftest", "sim:", "--frames", "3", "--json"});
  REQUIRE(good.status == 0);
  const Json answer = Json::parse(good.out);
  CHECK(answer["passed"] == true);
  CHECK(answer["frames_whole"] == 3);
  CHECK(answer["wrong_pixels"] == 0);
  CHECK(answer["pixels"] == 3 * 480 * 480);
  const Finished lossy = scatter({"selftest", "sim:?fault=drop:0.05&seed=3", "--json"});
  CHECK(lossy.status == 1);
  const Json lost = Json::parse(lossy.out);
  CHECK(lost["passed"] == false);
  CHECK(lost["ledger"]["balances"] == true);
  CHECK(lost["ledger"]["lost_link"] > 0);
}

TEST_CASE("Ctrl-C ends scatter conform at once with status 1") {
  Command command(
      {"conform", "sim:?clock=real", "--only", "objects", "--only", "cut-frame", "--only", "clock"});
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  command.signal(SIGINT);
  const Finished finished = command.wait(std::chrono::seconds(10));
  CHECK(finished.status == 1);
  CHECK(finished.err.find("stopped") != std::string::npos);
}
