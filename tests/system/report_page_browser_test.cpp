// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// report.html in a browser: a script that is added to a copy of the page looks at what was drawn,
// uses it as a person would, and leaves what it saw in the document.
#include "../unit/evaluation/made_session.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using tests::CommandResult;
using tests::run_command;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

/// Chromium is no dependency of the project: TRIGPOINT_CHROMIUM names one elsewhere.
std::string browser() {
  const char* const named = std::getenv("TRIGPOINT_CHROMIUM");
  const std::string program = named != nullptr ? named : "chromium";
  return run_command({program, "--version"}, 30s).exit_code == 0 ? program : "";
}

/// Before the page's own scripts. Without a screen frames come when they please and time does not
/// wait for them (virtual time): timers stand in for them.
constexpr const char* kWatch = R"(<script>
const complaints = [];
window.requestAnimationFrame = (work) => setTimeout(() => work(performance.now()), 16);
addEventListener('error', (e) => complaints.push('error: ' + e.message));
addEventListener('securitypolicyviolation', (e) => complaints.push('would load ' + e.blockedURI));
for (const kind of ['error', 'warn']) {
  const said = console[kind];
  console[kind] = (...words) => { complaints.push(kind + ': ' + words.join(' ')); said(...words); };
}
</script>)";

/// After them. Each line of #seen is "name value".
constexpr const char* kLook = R"(<pre id="seen" style="overflow:hidden"></pre><script>
const tell = (name, value) => { document.getElementById('seen').textContent += `${name} ${value}\n`; };
const canvas = document.getElementById('view');
const pixels = () => {
  const gl = canvas.getContext('webgl');
  const bytes = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  return bytes;
};
const differing = (a, b) => {
  let n = 0;
  for (let i = 0; i < a.length; i += 4) n += a[i] !== b[i] || a[i + 1] !== b[i + 1] || a[i + 2] !== b[i + 2];
  return n;
};
const soon = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
const shown_numbers = (id) => [...document.querySelectorAll(`#${id} .numbers .x`)].map((s) => s.textContent).join(',');
const point_at = (element, kind, u, v, more = {}) => {
  const box = element.getBoundingClientRect();
  element.dispatchEvent(new PointerEvent(kind, {
    bubbles: true, pointerId: 1, pointerType: 'mouse', clientX: box.left + u * box.width, clientY: box.top + v * box.height, ...more}));
};
(async () => {
  await soon();
  tell('points', canvas.dataset.drawn);
  const first = pixels();
  const blank = new Uint8Array(first.length);
  for (let i = 0; i < blank.length; i += 4) blank.set(first.subarray(0, 4), i);  // a corner is background
  tell('of', first.length / 4);
  tell('drawn', differing(first, blank));
  canvas.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'}));
  await soon();
  const turned = pixels();
  tell('turned', differing(first, turned));
  document.getElementById('view-top').click();
  await soon();
  tell('from_above', differing(turned, pixels()));
  // The page's own element: another one is decoded in a thread for which virtual time does not wait.
  const shown = document.querySelector('#top-view image');
  const head = atob(shown.getAttribute('href').slice('data:image/png;base64,'.length).slice(0, 32));
  const number_at = (at) => [0, 1, 2, 3].reduce((n, i) => 256 * n + head.charCodeAt(at + i), 0);
  const picture = {width: number_at(16), height: number_at(20)};
  const flat = Object.assign(document.createElement('canvas'), picture).getContext('2d');
  flat.drawImage(shown, 0, 0, picture.width, picture.height);
  const cells = flat.getImageData(0, 0, picture.width, picture.height).data;
  tell('picture_cells', picture.width * picture.height);
  tell('picture_drawn', cells.filter((value, i) => i % 4 === 3 && value > 0).length);
  const error = document.querySelector('#error .drawing');
  error.setPointerCapture = () => {};
  point_at(error, 'pointermove', 0.25, 0.5);
  tell('tip', document.querySelector('.tip').innerText.replaceAll('\n', '; '));
  tell('spot', !document.querySelector('#top-view .spot').hidden);
  tell('before', shown_numbers('height'));
  point_at(error, 'pointerdown', 0.25, 0.5, {button: 0});
  point_at(error, 'pointermove', 0.5, 0.5, {buttons: 1});
  point_at(error, 'pointerup', 0.5, 0.5);
  tell('zoomed', shown_numbers('height'));
  tell('wider_than_window', document.documentElement.scrollWidth - innerWidth);
  tell('too_wide', [...document.querySelectorAll('body *')].filter((e) => e.getBoundingClientRect().right > innerWidth + 1 && !e.closest('nav, .scroll, svg')).map((e) => e.id || e.className || e.tagName + e.textContent.slice(0, 30)).slice(0, 5).join(','));
  tell('complaints', complaints.join(' | '));
  tell('end', 1);
})();
</script></body>)";

std::string with_scripts(std::string page) {
  page.insert(page.find("<title>"), kWatch);
  return page.replace(page.rfind("</body>"), 7, kLook);
}

/// What kLook told, in a window of this width.
std::map<std::string, std::string> look_at(const std::string& chromium,
                                           const std::string& page_file,
                                           int width_px) {
  const TemporaryFolder profile;
  const CommandResult run = run_command({chromium,
                                         "--headless=new",
                                         "--no-sandbox",
                                         "--use-angle=swiftshader",
                                         "--enable-unsafe-swiftshader",
                                         "--user-data-dir=" + profile.path(),
                                         "--window-size=" + std::to_string(width_px) + ",900",
                                         "--virtual-time-budget=60000",
                                         "--dump-dom",
                                         "file://" + page_file},
                                        150s);
  const auto from = run.output.rfind("<pre id=\"seen\"");
  std::map<std::string, std::string> seen;
  if (from == std::string::npos) {
    return {{"output", run.output.substr(0, 2000)}};
  }
  const auto begin = run.output.find('>', from) + 1;
  std::istringstream in(run.output.substr(begin, run.output.find("</pre>", begin) - begin));
  for (std::string line; std::getline(in, line);) {
    seen[line.substr(0, line.find(' '))] = line.substr(std::min(line.size(), line.find(' ') + 1));
  }
  return seen;
}

double number(const std::map<std::string, std::string>& seen, const std::string& name) {
  const auto found = seen.find(name);
  return found == seen.end() || found->second.empty() ? -1.0
                                                      : std::strtod(found->second.c_str(), nullptr);
}

class ReportInABrowser : public ::testing::Test {
 protected:
  void SetUp() override {
    chromium_ = browser();
    if (chromium_.empty()) {
      GTEST_SKIP() << "there is no chromium (Debian package chromium, or TRIGPOINT_CHROMIUM)";
    }
    const std::string session = folder_.path("session");
    evaluation::test::make_session(session);
    const auto report =
        run_command({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "report", session});
    ASSERT_EQ(report.exit_code, 0) << report.output;
    ASSERT_THAT(report.output, HasSubstr(session + "/report.html"));
    page_ = folder_.path("looked_at.html");
    std::ofstream(page_, std::ios::binary)
        << with_scripts(tests::read_file(session + "/report.html"));
  }

  std::string chromium_;
  std::string page_;
  TemporaryFolder folder_;
};

TEST_F(ReportInABrowser, is_drawn_without_complaint_and_answers_to_the_mouse) {
  const auto seen = look_at(chromium_, page_, 1280);
  ASSERT_EQ(number(seen, "end"), 1.0) << ::testing::PrintToString(seen);
  EXPECT_EQ(seen.at("complaints"), "");
  const double pixels = number(seen, "of");
  EXPECT_GT(pixels, 500'000.0);
  EXPECT_GT(number(seen, "points"), 100'000.0);
  EXPECT_GT(number(seen, "drawn"), 0.02 * pixels);
  EXPECT_GT(number(seen, "turned"), 0.02 * pixels);
  EXPECT_GT(number(seen, "from_above"), 0.02 * pixels);
  EXPECT_GT(number(seen, "picture_drawn"), 0.02 * number(seen, "picture_cells"));
  EXPECT_LT(number(seen, "picture_drawn"), 0.50 * number(seen, "picture_cells"));
  // At 30 s of 120 s fused was made 3 cm off, and lio 0.01 m/s * (30 - 60) s after its mean.
  EXPECT_THAT(seen.at("tip"), HasSubstr("t = 30 s"));
  EXPECT_THAT(seen.at("tip"), HasSubstr("fused: 0.03"));
  EXPECT_THAT(seen.at("tip"), HasSubstr("translation): 0.3"));
  EXPECT_EQ(seen.at("spot"), "true");
  EXPECT_EQ(seen.at("before"), "0,20,40,60,80,100,120");
  EXPECT_EQ(seen.at("zoomed"), "30,35,40,45,50,55,60");
}

TEST_F(ReportInABrowser, fits_a_telephone) {
  const auto seen = look_at(chromium_, page_, 500);  // headless windows are no narrower
  ASSERT_EQ(number(seen, "end"), 1.0) << ::testing::PrintToString(seen);
  EXPECT_LE(number(seen, "wider_than_window"), 0.0) << seen.at("too_wide");
  EXPECT_EQ(seen.at("complaints"), "");
}

}  // namespace
}  // namespace trigpoint
