#include "tools/plot/report.h"

#include <fmt/format.h>

#include <string_view>

#include "tools/plot/html.h"

namespace scatter::plot {
namespace {

constexpr std::string_view kStyle = R"css(
:root{color-scheme:light dark;--page:#f5f6f8;--card:#fff;--text:#181b20;--faint:#5d646f;--line:#e1e4e9;
--ok:#0b7a43;--ok-bg:#e2f5ea;--warn:#8a5a00;--warn-bg:#fdf1d6;--fail:#b3202a;--fail-bg:#fde5e6;--none:#4c5566;--none-bg:#e9ecf1}
@media(prefers-color-scheme:dark){:root{--page:#0b0d10;--card:#14171c;--text:#e8eaee;--faint:#9aa1ad;--line:#272c34;
--ok:#67d79a;--ok-bg:#12301f;--warn:#f0c060;--warn-bg:#352a10;--fail:#ff8a8f;--fail-bg:#3b1518;--none:#b2bac8;--none-bg:#232932}
.on-light{display:none}}
@media not all and (prefers-color-scheme:dark){.on-dark{display:none}}
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--text);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:62rem;margin:0 auto;padding:1.5rem 1rem 3rem}
header p,.faint{color:var(--faint)}
h1{font-size:1.7rem;line-height:1.2;margin:.2rem 0;overflow-wrap:anywhere}
h2{font-size:1.1rem;margin:0 0 .7rem}
header p{margin:.2rem 0}
.kind{letter-spacing:.08em;text-transform:uppercase;font-size:.75rem;font-weight:600}
section{background:var(--card);border:1px solid var(--line);border-radius:12px;padding:1rem 1.1rem;margin:1rem 0}
.verdict{display:flex;gap:.8rem;align-items:center;border-radius:12px;padding:.8rem 1.1rem;margin:1rem 0}
.verdict b{font-size:1.05rem}
.facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(8.5rem,1fr));gap:.7rem;margin:1rem 0}
.facts div{background:var(--card);border:1px solid var(--line);border-radius:12px;padding:.7rem .9rem}
.facts b{display:block;font-size:1.25rem;font-variant-numeric:tabular-nums}
.facts span{color:var(--faint);font-size:.82rem}
.wide{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums;font-size:.92rem}
th{text-align:left;color:var(--faint);font-weight:500;font-size:.82rem}
th,td{padding:.42rem .7rem .42rem 0;border-top:1px solid var(--line);vertical-align:top}
tr:first-child th{border-top:0}
td.number{white-space:nowrap}
td.long{overflow-wrap:anywhere;min-width:11rem}
.advice{min-width:14rem}
.ok{color:var(--ok);background:var(--ok-bg)}.warn{color:var(--warn);background:var(--warn-bg)}
.fail{color:var(--fail);background:var(--fail-bg)}.none{color:var(--none);background:var(--none-bg)}
.chip{border-radius:99px;padding:.08rem .6rem;font-size:.8rem;font-weight:600;white-space:nowrap}
figure{margin:0}
figure img,figure svg{display:block;width:100%;height:auto;border-radius:8px}
figure .picture{max-width:56rem;margin:0 auto}
.on-light svg,.on-dark svg{min-width:38rem}
figcaption{color:var(--faint);font-size:.85rem;margin-top:.6rem}
code{font:.86em ui-monospace,"DejaVu Sans Mono",monospace}
@media(max-width:40rem){.checks tr:first-child{display:none}.checks tr{display:grid;grid-template-columns:1fr auto;gap:0 .6rem;
border-top:1px solid var(--line);padding:.5rem 0}.checks td{border:0;padding:.1rem 0}.checks .advice{grid-column:1/-1;min-width:0}.checks .limit{display:none}}
@media print{body{background:#fff}section{break-inside:avoid}}
)css";

std::string_view css_class(Mark mark) {
  switch (mark) {
    case Mark::kOk:
      return "ok";
    case Mark::kWarn:
      return "warn";
    case Mark::kFail:
      return "fail";
    case Mark::kCannotTell:
      return "none";
  }
  return "none";
}

std::string_view word(Mark mark) {
  switch (mark) {
    case Mark::kOk:
      return "✓ ok";
    case Mark::kWarn:
      return "! warning";
    case Mark::kFail:
      return "✗ fail";
    case Mark::kCannotTell:
      return "? cannot tell";
  }
  return "?";
}

std::string_view headline(Mark mark) {
  switch (mark) {
    case Mark::kWarn:
      return "Usable, with remarks";
    case Mark::kFail:
      return "Do not use this result yet";
    default:
      return "Good to use";
  }
}

/// An SVG file without its XML declaration, its ids made unique on the page.
std::string inline_svg(std::string_view file, std::string_view prefix) {
  const auto start = file.find("<svg");
  std::string svg(start == std::string_view::npos ? std::string_view() : file.substr(start));
  for (const std::string_view key : {"id=\"", "href=\"#", "url(#"}) {
    for (auto at = svg.find(key); at != std::string::npos; at = svg.find(key, at + key.size())) {
      svg.insert(at + key.size(), prefix);
    }
  }
  return svg;
}

void quality_section(std::string& page, const ReportContent& content) {
  if (content.quality.empty()) {
    return;
  }
  page +=
      "<section><h2>Quality</h2><div class=wide><table "
      "class=checks><tr><th>Check<th>Value<th>Limit<th>Verdict<th>What it "
      "says</tr>\n";
  for (const auto& row : content.quality) {
    page += fmt::format(
        "<tr><td>{}<td class=number>{}<td class=\"number limit\">{}<td><span class=\"chip {}\">{}</span><td "
        "class=advice>{}</tr>\n",
        html_escaped(row.name), html_escaped(row.value), html_escaped(row.limit), css_class(row.mark),
        word(row.mark), html_escaped(row.advice));
  }
  page += "</table></div></section>\n";
}

void picture_sections(std::string& page, const ReportContent& content) {
  if (!content.hemispheres_png.empty()) {
    page += fmt::format(
        "<section><h2>Scattering hemispheres</h2><figure><div class=picture><img alt=\"{} in false colour, "
        "one disc per illumination\" "
        "src=\"data:image/png;base64,{}\"></div><figcaption>Each disc is the whole hemisphere seen along the "
        "normal: "
        "the centre is the normal, the rim the horizon; rows are incidences, columns colours of "
        "light.</figcaption></figure></section>\n",
        html_escaped(content.quantity), base64(content.hemispheres_png));
  }
  if (!content.curves_light_svg.empty()) {
    page += "<section><h2>In the plane of incidence</h2><figure>";
    page += "<div class=\"wide on-light\">" + inline_svg(content.curves_light_svg, "l-") + "</div>";
    if (!content.curves_dark_svg.empty()) {
      page += "<div class=\"wide on-dark\">" + inline_svg(content.curves_dark_svg, "d-") + "</div>";
    }
    page += "<figcaption>Bands: ±2 standard uncertainties, about 95 %.</figcaption></figure></section>\n";
  }
}

void albedo_section(std::string& page, const ReportContent& content) {
  if (content.albedo.empty()) {
    return;
  }
  page += fmt::format("<section><h2>{} over the measured region</h2><div class=wide><table><tr><th>Incidence",
                      content.quantity == "BTDF" ? "Transmittance" : "Albedo");
  for (const auto& channel : content.albedo_channels) {
    page += "<th>" + html_escaped(channel);
  }
  page += "</tr>\n";
  for (const auto& row : content.albedo) {
    page += "<tr><td class=number>" + html_escaped(row.incidence);
    for (const auto& cell : row.channels) {
      page += fmt::format("<td class=number>{:.4f} <span class=faint>± {:.4f}</span>", cell.albedo,
                          2 * cell.standard_uncertainty);
    }
    page += "</tr>\n";
  }
  page +=
      "</table></div><p class=faint>± two standard uncertainties. The share of the light that leaves into "
      "the measured "
      "angles; what leaves closer to the horizon is not in it.</p></section>\n";
}

void fact_table(std::string& page, std::string_view heading, const std::vector<ReportContent::Fact>& facts) {
  if (facts.empty()) {
    return;
  }
  page += fmt::format("<section><h2>{}</h2><div class=wide><table>\n", heading);
  for (const auto& fact : facts) {
    page +=
        fmt::format("<tr><th>{}<td class=long>{}</tr>\n", html_escaped(fact.name), html_escaped(fact.value));
  }
  page += "</table></div></section>\n";
}

}  // namespace

std::string report(const ReportContent& content) {
  std::string page;
  page.reserve(64 * 1024 + content.hemispheres_png.size() * 4 / 3 + content.curves_light_svg.size() +
               content.curves_dark_svg.size());
  page +=
      "<!doctype html>\n<html lang=en><head><meta charset=utf-8>\n"
      "<meta name=viewport content=\"width=device-width,initial-scale=1\">\n";
  page += fmt::format("<title>{} · {}</title>\n<style>{}</style></head>\n<body><main>\n",
                      html_escaped(content.title), html_escaped(content.quantity), kStyle);
  page += fmt::format("<header><p class=kind>OpenScatter · {} measurement</p><h1>{}</h1><p>{}</p></header>\n",
                      html_escaped(content.quantity), html_escaped(content.title),
                      html_escaped(content.subtitle));
  page +=
      fmt::format("<div class=\"verdict {}\"><div><b>{}</b><br>{}</div></div>\n", css_class(content.verdict),
                  headline(content.verdict), html_escaped(content.verdict_text));
  if (!content.facts.empty()) {
    page += "<div class=facts>";
    for (const auto& fact : content.facts) {
      page += fmt::format("<div><b>{}</b><span>{}</span></div>", html_escaped(fact.value),
                          html_escaped(fact.name));
    }
    page += "</div>\n";
  }
  picture_sections(page, content);
  albedo_section(page, content);
  quality_section(page, content);
  fact_table(page, "Frames: where each one went", content.ledger);
  fact_table(page, "Provenance", content.provenance);
  page += "</main></body></html>\n";
  return page;
}

}  // namespace scatter::plot
