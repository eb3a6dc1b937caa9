"use strict";
// Shows the messages of the server, and sends commands of the user to it.

const SVG = "http://www.w3.org/2000/svg";
const STATUS = ["running", "success", "failure", "invalid"];
const COLOURS = ["#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00"];
const SCROLL_PERIOD = 400; // ms

const find = (id) => document.getElementById(id);
const state = { nodes: {}, items: {}, paused: false, over: false };
const groups = new Map();
const classes = [];
let lastScroll = 0;

const address = new URL("live", location.href);
address.protocol = "ws:";
const socket = new WebSocket(address);
socket.onopen = () => {
  if (rendersOnCpu()) send({ do: "spare" });
};
socket.onmessage = (message) => show(JSON.parse(message.data));
socket.onclose = () => {
  if (!state.result) headline("failure", "the run is gone");
  for (const button of document.querySelectorAll("button")) button.disabled = true;
};
find("whole").onchange = () => document.querySelector("#tree .scroll").classList.toggle("whole", find("whole").checked);
for (const command of ["pause", "resume", "step", "stop"]) find(command).onclick = () => send({ do: command });

function send(command) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
}

function rendersOnCpu() {
  const context = document.createElement("canvas").getContext("webgl");
  const extension = context && context.getExtension("WEBGL_debug_renderer_info");
  return !extension || /swiftshader|llvmpipe|software/i.test(context.getParameter(extension.UNMASKED_RENDERER_WEBGL));
}

function show(changes) {
  const { nodes, items, ...rest } = changes;
  Object.assign(state, rest);
  if ("tree" in changes) showTree(changes.tree);
  for (const [path, node] of Object.entries(nodes ?? {})) {
    state.nodes[path] = node;
    showStatus(path, node);
    // The last failure is shown with the message of its skill; control nodes only pass it on.
    const group = groups.get(path);
    if (node.status === "failure" && node.said && group?.classList.contains("skill")) {
      find("said").textContent = `${path.split("/").pop().split(":").pop()}: ${node.said}`;
    }
  }
  Object.assign(state.items, items);
  if ("run" in changes) {
    find("mission").textContent = `${changes.run.mission}, seed ${changes.run.seed}`;
    document.title = `${changes.run.mission} · executive`;
  }
  if ("clock" in changes) find("clock").textContent = `${changes.clock.toFixed(1)} s`;
  if (items) showItems();
  if ("look" in changes || "decision" in changes || (items && state.look)) showCamera();
  if ("asking" in changes) ask(changes.asking);
  if (changes.note) find("said").textContent = changes.note;
  if (nodes) scrollToRunning();
  if ("result" in changes) showResult(changes.result);
  else if (!state.result) {
    const status = state.paused ? "paused" : state.asking ? "asking" : "running";
    headline(state.over ? "invalid" : "running", state.over ? "ending" : status);
  }
  find("pause").disabled = state.paused || state.over;
  find("resume").disabled = !state.paused || state.over;
  find("step").disabled = find("stop").disabled = state.over;
}

function headline(kind, text) {
  find("head").className = kind;
  find("status").textContent = text;
}

function showTree(text) {
  const tree = document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
  document.querySelector("#tree .scroll").replaceChildren(tree);
  groups.clear();
  for (const group of tree.querySelectorAll("g.node")) groups.set(group.dataset.path, group);
  for (const [path, node] of Object.entries(state.nodes)) showStatus(path, node);
}

function showStatus(path, node) {
  const group = groups.get(path);
  if (!group) return;
  group.classList.remove(...STATUS);
  group.classList.add(node.status);
  const counts = [[node.done, "✓"], [node.failed, "✗"], [node.halted, "–"]];
  const texts = counts.filter(([number]) => number).map(([number, mark]) => `${number} ${mark}`);
  const note = group.querySelector(".note");
  if (note) note.textContent = texts.join("  ");
  // Draw the line to a running node above the lines to its siblings.
  if (node.status === "running" && group.nextElementSibling) group.parentNode.append(group);
}

function scrollToRunning() {
  const now = performance.now();
  if (!find("follow").checked || now - lastScroll < SCROLL_PERIOD) return;
  const running = [...groups.values()].filter((g) => g.classList.contains("skill") && g.classList.contains("running"));
  const target = running[0];
  if (!target) return;
  lastScroll = now;
  const frame = document.querySelector("#tree .scroll");
  const box = target.querySelector(".box").getBoundingClientRect();
  const view = frame.getBoundingClientRect();
  const inside = box.left >= view.left && box.right <= view.right && box.top >= view.top && box.bottom <= view.bottom;
  if (inside) return;
  // Without animation: the smooth scroll of a large drawing would slow down the run.
  frame.scrollTo({
    left: frame.scrollLeft + box.left - view.left - 0.62 * view.width,
    top: frame.scrollTop + box.top - view.top - 0.4 * view.height,
  });
}

function showItems() {
  const rows = Object.values(state.items).filter((item) => item.state !== "phantom");
  find("items").querySelector("tbody").replaceChildren(...rows.map((item) => {
    const row = document.createElement("tr");
    row.className = item.state;
    for (const text of [item.item, item.label, item.state, item.bin, item.why]) {
      row.appendChild(document.createElement("td")).textContent = text ?? "";
    }
    return row;
  }));
}

function showCamera() {
  const look = state.look;
  if (!look) return;
  const shown = makeElement("svg", { viewBox: `0 0 ${look.width} ${look.height}`, class: "look" });
  shown.append(makeElement("image", { href: look.source, width: look.width, height: look.height }));
  const chosen = findChosen(look);
  look.found.forEach((box, number) => shown.append(...drawBox(box, number === chosen)));
  document.querySelector("#look .picture").replaceChildren(shown);
  find("frame").textContent = `${look.camera}, frame ${look.frame} at ${look.stamp.toFixed(2)} s, by ${look.detector}`;
}

function drawBox(box, chosen) {
  const [left, top, right, bottom] = box.box;
  if (!classes.includes(box.label)) classes.push(box.label);
  const colour = COLOURS[classes.indexOf(box.label) % COLOURS.length];
  const drawn = makeElement("rect", { x: left, y: top, width: right - left, height: bottom - top, class: chosen ? "chosen" : "" });
  drawn.style.stroke = colour;
  const label = makeElement("text", { x: left, y: top - 4 });
  label.textContent = `${chosen ? state.decision.item : box.label} ${box.confidence.toFixed(2)}`;
  label.style.fill = colour;
  return [drawn, label];
}

function findChosen(look) {
  const item = state.decision && state.items[state.decision.item];
  if (!item || !item.position || item.state === "placed") return -1;
  const distance = (box) => (box.position ? Math.hypot(box.position[0] - item.position[0], box.position[1] - item.position[1]) : Infinity);
  const best = look.found.reduce((a, box, number) => (a < 0 || distance(box) < distance(look.found[a]) ? number : a), -1);
  return best >= 0 && distance(look.found[best]) < 0.03 ? best : -1;
}

function makeElement(tag, attributes) {
  const made = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function ask(choices) {
  const panel = find("asking");
  panel.hidden = !choices;
  for (const button of panel.querySelectorAll("button")) button.remove();
  const words = choices ? [...choices, "rescan", "quit"] : [];
  for (const word of words) {
    const button = panel.appendChild(document.createElement("button"));
    button.textContent = word;
    button.onclick = () => send({ do: "request", word });
  }
}

function showResult(result) {
  const kinds = { SUCCESS: "success", FAILURE: "failure", FAULT: "failure" };
  headline(kinds[result.status] ?? "invalid", result.status);
  const panel = find("outcome");
  panel.hidden = false;
  panel.className = kinds[result.status] ?? "invalid";
  const lines = [
    result.sentence,
    result.report ? `report: ${result.report}` : `record: ${result.run}`,
  ];
  panel.replaceChildren(...lines.filter(Boolean).map((line) => {
    const paragraph = document.createElement("p");
    paragraph.textContent = line;
    return paragraph;
  }));
}
