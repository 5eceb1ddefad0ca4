#include "tools/plot/report.h"

#include <catch2/catch.hpp>

#include "tools/plot/html.h"

using namespace scatter::plot;

TEST_CASE("Base64 gives the test vectors of RFC 4648") {
  CHECK(base64("").empty());
  CHECK(base64("f") == "Zg==");
  CHECK(base64("fo") == "Zm8=");
  CHECK(base64("foo") == "Zm9v");
  CHECK(base64("foob") == "Zm9vYg==");
  CHECK(base64("fooba") == "Zm9vYmE=");
  CHECK(base64("foobar") == "Zm9vYmFy");
  CHECK(base64(std::string("\xff\xfe\x00", 3)) == "//4A");
}

namespace {

ReportContent full() {
  const std::string hostile = "<script>alert(\"x\")</script>&'";
  ReportContent content;
  content.title = hostile;
  content.subtitle = hostile;
  content.quantity = "BRDF";
  content.verdict_text = hostile;
  content.facts = {{hostile, hostile}};
  content.quality = {{hostile, "1", "2", Mark::kWarn, hostile}};
  content.albedo_channels = {hostile};
  content.albedo = {{hostile, {{0.5, 0.01}}}};
  content.ledger = {{"exposed", "48"}};
  content.provenance = {{hostile, hostile}};
  content.hemispheres_png = "PNG bytes";
  content.curves_light_svg =
      "<?xml version=\"1.0\"?>\n<svg><g id=\"a\"/><use href=\"#a\" fill=\"url(#a)\"/></svg>";
  content.curves_dark_svg = content.curves_light_svg;
  return content;
}

}  // namespace

TEST_CASE("The report fetches nothing and runs nothing") {
  const std::string page = report(full());
  CHECK(page.find("<script") == std::string::npos);
  CHECK(page.find("http:") == std::string::npos);
  CHECK(page.find("https:") == std::string::npos);
  CHECK(page.find("src=\"data:image/png;base64,UE5HIGJ5dGVz\"") != std::string::npos);
}

TEST_CASE("Text from outside stays text in the report") {
  const std::string page = report(full());
  CHECK(page.find("alert(\"x\")") == std::string::npos);
  CHECK(page.find("&lt;script&gt;alert(&quot;x&quot;)&lt;/script&gt;&amp;&#39;") != std::string::npos);
}

TEST_CASE("Two inline pictures do not share ids") {
  const std::string page = report(full());
  CHECK(page.find("id=\"l-a\"") != std::string::npos);
  CHECK(page.find("id=\"d-a\"") != std::string::npos);
  CHECK(page.find("href=\"#l-a\"") != std::string::npos);
  CHECK(page.find("url(#d-a)") != std::string::npos);
  CHECK(page.find("<?xml") == std::string::npos);
}

TEST_CASE("The report shows two standard uncertainties and the ledger") {
  const std::string page = report(full());
  CHECK(page.find("0.5000 <span class=faint>± 0.0200</span>") != std::string::npos);
  CHECK(page.find("<th>exposed<td class=long>48") != std::string::npos);
}

TEST_CASE("A section without contents is left out of the report") {
  const std::string page = report({.title = "t", .quantity = "BRDF"});
  CHECK(page.find("<table") == std::string::npos);
  CHECK(page.find("<figure>") == std::string::npos);
}
