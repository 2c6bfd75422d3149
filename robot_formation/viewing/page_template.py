"""The page of an exported view: what `view_page` fills in stands between @ signs.

The scene is viser's own page in a frame of its own, with its playback bar. The script reads the time from that bar, and
sets it for a step; where it finds none, texts and pictures stay those of the start.
"""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@TITLE@</title>
<style>
* { box-sizing: border-box; }
html, body { margin: 0; height: 100%; font: 15px/1.45 system-ui, sans-serif; color: #222; background: #fff; }
body { display: grid; grid-template: "head head" auto "scene side" minmax(0, 1fr) / minmax(0, 1fr) 24rem; }
header { grid-area: head; padding: .5rem 1rem; border-bottom: 1px solid #ddd; }
h1 { display: inline; font-size: 1.05rem; margin: 0 .6rem 0 0; }
iframe { grid-area: scene; width: 100%; height: 100%; border: 0; }
main { grid-area: side; overflow: auto; padding: .8rem 1rem; border-left: 1px solid #ddd; }
h2 { font-size: .95rem; margin: 1rem 0 .3rem; }
h2:first-child { margin-top: 0; }
p { margin: 0 0 .5rem; }
#state { min-height: 3rem; }
#time { font-variant-numeric: tabular-nums; }
img { width: 100%; display: block; background: #eee; aspect-ratio: 316 / 208; }
svg { width: 100%; height: auto; display: block; }
svg text { font: 11px system-ui, sans-serif; fill: #444; }
small { color: #666; }
button, select { font: inherit; padding: .15rem .6rem; }
.error { color: #0072b2; } .correction { color: #c14e00; }
@media (max-width: 800px) {
  body { height: auto; grid-template: "head" auto "scene" 62vh "side" auto / minmax(0, 1fr); }
  main { border-left: 0; border-top: 1px solid #ddd; }
}
</style>
</head>
<body>
<header><h1>@TITLE@</h1> <span>outcome: @OUTCOME@</span></header>
<iframe id="scene" title="the run in three dimensions" srcdoc="@SCENE@"></iframe>
<main>
<h2 id="who"></h2>
<p id="state">has not begun</p>
<p id="time"></p>
<p><button id="step">next timestep</button> <select id="choice" aria-label="follower" hidden></select></p>
<h2>What its camera saw, with blocks</h2>
<img id="picture" alt="the camera's picture with the blocks that were found in it">
<small id="rendered" hidden>The bag holds no pictures: these are rendered from ground truth.</small>
<h2><span class="error">formation error</span> and <span class="correction">correction</span> (cm) by timestep</h2>
<svg id="plot" viewBox="0 0 340 190" role="img" aria-label="formation error and correction by timestep"></svg>
<p><small>A rectangle on the ground is a robot's place in formation. Black lines over a robot are the forecast of its
next displacement with its 90 % ellipse. Drag to turn the view, scroll to come closer.</small></p>
</main>
<script type="application/json" id="data">@DATA@</script>
<script>
"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const element = id => document.getElementById(id);
const names = Object.keys(data.followers);
let name = names[0], shown = {};
const scene = element("scene");

function inScene(selector) {
  try { return scene.contentDocument.querySelector(selector); } catch { return null; }
}
function seconds() {
  const slider = inScene("[role=slider]");
  return slider ? Number(slider.getAttribute("aria-valuenow")) * data.scale : 0;
}
function goTo(second) {
  const input = inScene("input");
  if (!input) return;
  const view = scene.contentWindow;
  const { set } = Object.getOwnPropertyDescriptor(view.HTMLInputElement.prototype, "value");
  set.call(input, String(second / data.scale));
  input.dispatchEvent(new view.Event("input", { bubbles: true }));
}
function last(rows, second) {
  let low = 0, high = rows.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((Array.isArray(rows[middle]) ? rows[middle][0] : rows[middle]) <= second + 1e-3) low = middle + 1;
    else high = middle;
  }
  return low;
}
function set(key, value, apply) {
  if (shown[key] !== value) { shown[key] = value; apply(value); }
}
function update() {
  const second = seconds(), follower = data.followers[name];
  const state = last(follower.states, second), finished = last(follower.ends, second);
  const picture = last(follower.pictures, second);
  set("state", state ? follower.states[state - 1][1] : "has not begun", text => element("state").textContent = text);
  const of = data.timesteps ? ` of ${data.timesteps}` : "";
  set("time", `${second.toFixed(1)} s simulated, ${finished}${of} timesteps finished`,
      text => element("time").textContent = text);
  set("picture", picture, number => {
    if (number) element("picture").src = "data:image/jpeg;base64," + follower.pictures[number - 1][1];
    else element("picture").removeAttribute("src");
  });
  set("finished", finished, draw);
}
function draw(finished) {
  const figures = data.followers[name].figures, count = Math.max(data.timesteps || 0, figures.length, 1);
  const most = Math.max(1, ...figures.flatMap(row => [row[1] || 0, row[2] || 0]));
  const rough = most / 4, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(factor => factor * power >= rough), top = Math.ceil(most / step) * step;
  const x = t => 32 + (t - 0.5) / count * 300, y = value => 160 - value / top * 150;
  let text = "";
  for (let value = 0; value <= top + step / 2; value += step) {
    text += `<line x1="32" x2="332" y1="${y(value)}" y2="${y(value)}" stroke="#ddd"/>` +
        `<text x="28" y="${y(value) + 4}" text-anchor="end">${Number(value.toFixed(6))}</text>`;
  }
  const every = Math.max(1, Math.ceil(count / 8));
  for (let t = every; t <= count; t += every) text += `<text x="${x(t)}" y="175" text-anchor="middle">${t}</text>`;
  for (const [column, colour] of [[1, "#d55e00"], [2, "#0072b2"]]) {
    const known = figures.filter(row => row[column] !== null);
    const line = rows => rows.map(row => `${x(row[0])},${y(row[column])}`).join(" ");
    text += `<polyline points="${line(known)}" fill="none" stroke="${colour}" stroke-opacity=".3" stroke-width="1.5"/>`;
    const done = known.filter(row => row[0] <= finished);
    text += `<polyline points="${line(done)}" fill="none" stroke="${colour}" stroke-width="2"/>`;
    if (count <= 60) for (const row of done)
      text += `<circle cx="${x(row[0])}" cy="${y(row[column])}" r="2.5" fill="${colour}"/>`;
  }
  const now = x(finished);
  if (finished) text += `<line x1="${now}" x2="${now}" y1="10" y2="160" stroke="#444" stroke-dasharray="3 3"/>`;
  text += `<text x="182" y="188" text-anchor="middle">timestep</text>`;
  element("plot").innerHTML = text;
}
function choose(chosen) {
  name = chosen;
  shown = {};
  element("who").textContent = name.replaceAll("_", " ");
  update();
}
for (const each of names) element("choice").add(new Option(each.replaceAll("_", " "), each));
element("choice").hidden = names.length < 2;
element("choice").onchange = event => choose(event.target.value);
element("rendered").hidden = !data.rendered;
element("step").onclick = () => {
  const ends = data.followers[name].ends, next = last(ends, seconds() + 0.05 * data.scale);
  if (ends.length) goTo(ends[next % ends.length] + 0.02 * data.scale);
};
choose(name);
setInterval(update, 100);
</script>
</body>
</html>
"""
