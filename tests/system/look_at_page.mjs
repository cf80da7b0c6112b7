// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Opens a page in headless Chromium, by its DevTools protocol, until it says something; prints its text.
//   node look_at_page.mjs NODE_MODULES URL PROFILE_FOLDER WORDS PICTURE.png [SCRIPT]
// Exit code 1 when the words do not come within a minute or a script of the page threw. SCRIPT is run in the
// page before the picture is taken.
import { spawn } from "node:child_process";
import { readFileSync, writeFileSync, existsSync } from "node:fs";
import { createRequire } from "node:module";
const [modules, url, profile, words, picture, script] = process.argv.slice(2);
const { WebSocket } = createRequire(modules + "/")("ws");
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const kLimit_ms = 60000;
const end_ms = Date.now() + kLimit_ms;

const browser = spawn(
  "chromium",
  ["--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-port=0", `--user-data-dir=${profile}`, "--window-size=1500,900", "about:blank"],
  { stdio: "ignore" },
);
const finish = (code) => {
  browser.kill("SIGKILL");
  process.exit(code);
};
const portFile = profile + "/DevToolsActivePort";
while (!existsSync(portFile) || !readFileSync(portFile, "utf8").includes("\n")) {
  if (Date.now() > end_ms) {
    console.log("chromium does not start");
    finish(1);
  }
  await pause(100);
}
const port = readFileSync(portFile, "utf8").split("\n")[0];
const pages = await (await fetch(`http://127.0.0.1:${port}/json`)).json();
const socket = new WebSocket(pages.find((page) => page.type === "page").webSocketDebuggerUrl);
await new Promise((opened) => socket.on("open", opened));

let threw = false;
let last = 0;
const waiting = new Map();
socket.on("message", (data) => {
  const message = JSON.parse(data);
  if (message.method === "Runtime.exceptionThrown") {
    threw = true;
    console.log("the page threw: " + JSON.stringify(message.params.exceptionDetails).slice(0, 500));
  }
  waiting.get(message.id)?.(message.result);
});
const call = (method, params = {}) =>
  new Promise((done) => {
    waiting.set(++last, done);
    socket.send(JSON.stringify({ id: last, method, params }));
  });
const evaluate = async (expression) => (await call("Runtime.evaluate", { expression })).result.value;

await call("Runtime.enable");
await call("Page.navigate", { url });
let text = "";
while (!text.includes(words) && Date.now() < end_ms) {
  await pause(200);
  text = (await evaluate("document.body?.innerText ?? ''")) ?? "";
}
console.log(text);
if (script) {
  await evaluate(script);
  await pause(2000);
}
const shot = await call("Page.captureScreenshot", { format: "png" });
writeFileSync(picture, Buffer.from(shot.data, "base64"));
finish(text.includes(words) && !threw ? 0 : 1);
