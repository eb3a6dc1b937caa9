"use strict";
// Shows the messages of the server, and sends commands of the user to it.

const SVG = "http://www.w3.org/2000/svg";
const STATUS_CLASSES = ["running", "success", "failure", "invalid"];
const CLASS_COLOURS = ["#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00"];
const SCROLL_PERIOD = 400; // minimum time between two scrolls of the tree [ms]
const MAX_TARGET_DISTANCE = 0.03; // maximum distance between the target and its detection [m]

const find = (id) => document.getElementById(id);
const state = { nodes: {}, items: {}, paused: false, has_ended: false }; // all values that the server sent
const groups = new Map(); // SVG group of each node by its path
const classes = []; // object classes in the order of their first detection
let lastScrollTime = 0;

const address = new URL("live", location.href);
address.protocol = "ws:";
const socket = new WebSocket(address);
socket.onopen = () => {
  if (rendersOnCpu()) send({ name: "render_on_cpu" });
};
socket.onmessage = (message) => applyChanges(JSON.parse(message.data));
socket.onclose = () => {
  if (!state.result) showRunStatus("failure", "connection lost");
  for (const button of document.querySelectorAll("button")) button.disabled = true;
};
find("whole").onchange = () => document.querySelector("#tree .scroll").classList.toggle("whole", find("whole").checked);
for (const command of ["pause", "resume", "step", "stop"]) find(command).onclick = () => send({ name: command });

function send(command) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
}

function rendersOnCpu() {
  const context = document.createElement("canvas").getContext("webgl");
  const extension = context && context.getExtension("WEBGL_debug_renderer_info");
  return !extension || /swiftshader|llvmpipe|software/i.test(context.getParameter(extension.UNMASKED_RENDERER_WEBGL));
}

function applyChanges(changes) {
  const { nodes, items, ...others } = changes;
  Object.assign(state, others);
  if ("tree" in changes) showTree(changes.tree);
  for (const [path, node] of Object.entries(nodes ?? {})) {
    state.nodes[path] = node;
    showNodeStatus(path, node);
    // Only failures of skills are shown, because control nodes only pass them on.
    const group = groups.get(path);
    if (node.status === "failure" && node.failure && group?.classList.contains("skill")) {
      find("message").textContent = `${path.split("/").pop().split(":").pop()}: ${node.failure}`;
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
  if ("choices" in changes) showChoices(changes.choices);
  if (changes.note) find("message").textContent = changes.note;
  if (nodes) scrollToRunning();
  if ("result" in changes) showResult(changes.result);
  else if (!state.result) {
    const status = state.paused ? "paused" : state.choices ? "waiting for a request" : "running";
    showRunStatus(state.has_ended ? "invalid" : "running", state.has_ended ? "ending" : status);
  }
  find("pause").disabled = state.paused || state.has_ended;
  find("resume").disabled = !state.paused || state.has_ended;
  find("step").disabled = find("stop").disabled = state.has_ended;
}

function showRunStatus(statusClass, text) {
  find("head").className = statusClass;
  find("status").textContent = text;
}

function showTree(svg) {
  const tree = document.importNode(new DOMParser().parseFromString(svg, "image/svg+xml").documentElement, true);
  document.querySelector("#tree .scroll").replaceChildren(tree);
  groups.clear();
  for (const group of tree.querySelectorAll("g.node")) groups.set(group.dataset.path, group);
  for (const [path, node] of Object.entries(state.nodes)) showNodeStatus(path, node);
}

function showNodeStatus(path, node) {
  const group = groups.get(path);
  if (!group) return;
  group.classList.remove(...STATUS_CLASSES);
  group.classList.add(node.status);
  const counts = [[node.done, "✓"], [node.failed, "✗"], [node.halted, "–"]];
  const texts = counts.filter(([count]) => count).map(([count, mark]) => `${count} ${mark}`);
  const note = group.querySelector(".note");
  if (note) note.textContent = texts.join("  ");
  // The line to a running node is drawn above the lines to its siblings.
  if (node.status === "running" && group.nextElementSibling) group.parentNode.append(group);
}

function scrollToRunning() {
  const now = performance.now();
  if (!find("follow").checked || now - lastScrollTime < SCROLL_PERIOD) return;
  const running = [...groups.values()].filter((g) => g.classList.contains("skill") && g.classList.contains("running"));
  const target = running[0];
  if (!target) return;
  lastScrollTime = now;
  const container = document.querySelector("#tree .scroll");
  const box = target.querySelector(".box").getBoundingClientRect();
  const view = container.getBoundingClientRect();
  const isVisible = box.left >= view.left && box.right <= view.right && box.top >= view.top && box.bottom <= view.bottom;
  if (isVisible) return;
  // The scroll has no animation, which would slow down the run if the drawing is large.
  container.scrollTo({
    left: container.scrollLeft + box.left - view.left - 0.62 * view.width,
    top: container.scrollTop + box.top - view.top - 0.4 * view.height,
  });
}

function showItems() {
  const rows = Object.values(state.items).filter((item) => item.state !== "phantom");
  find("items").querySelector("tbody").replaceChildren(...rows.map((item) => {
    const row = document.createElement("tr");
    row.className = item.state;
    for (const text of [item.item, item.label, item.state, item.bin, item.reason]) {
      row.appendChild(document.createElement("td")).textContent = text ?? "";
    }
    return row;
  }));
}

function showCamera() {
  const look = state.look;
  if (!look) return;
  const drawing = makeElement("svg", { viewBox: `0 0 ${look.width} ${look.height}`, class: "look" });
  drawing.append(makeElement("image", { href: look.source, width: look.width, height: look.height }));
  const targetIndex = findTarget(look);
  look.detections.forEach((detection, index) => drawing.append(...drawDetection(detection, index === targetIndex)));
  document.querySelector("#look .picture").replaceChildren(drawing);
  find("frame").textContent = `${look.camera}, frame ${look.frame} at ${look.stamp.toFixed(2)} s, by ${look.detector}`;
}

function drawDetection(detection, isTarget) {
  const [left, top, right, bottom] = detection.box;
  if (!classes.includes(detection.label)) classes.push(detection.label);
  const colour = CLASS_COLOURS[classes.indexOf(detection.label) % CLASS_COLOURS.length];
  const box = makeElement("rect", { x: left, y: top, width: right - left, height: bottom - top, class: isTarget ? "target" : "" });
  box.style.stroke = colour;
  const label = makeElement("text", { x: left, y: top - 4 });
  label.textContent = `${isTarget ? state.decision.item : detection.label} ${detection.confidence.toFixed(2)}`;
  label.style.fill = colour;
  return [box, label];
}

// Return the index of the detection of the selected target, or -1.
function findTarget(look) {
  const item = state.decision && state.items[state.decision.item];
  if (!item || !item.position || item.state === "placed") return -1;
  const distance = (detection) => (detection.position ? Math.hypot(detection.position[0] - item.position[0], detection.position[1] - item.position[1]) : Infinity);
  const nearest = look.detections.reduce((best, detection, index) => (best < 0 || distance(detection) < distance(look.detections[best]) ? index : best), -1);
  return nearest >= 0 && distance(look.detections[nearest]) < MAX_TARGET_DISTANCE ? nearest : -1;
}

function makeElement(tag, attributes) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

function showChoices(choices) {
  const panel = find("request");
  panel.hidden = !choices;
  for (const button of panel.querySelectorAll("button")) button.remove();
  const texts = choices ? [...choices, "rescan", "quit"] : [];
  for (const text of texts) {
    const button = panel.appendChild(document.createElement("button"));
    button.textContent = text;
    button.onclick = () => send({ name: "request", text });
  }
}

function showResult(result) {
  const statusClass = { SUCCESS: "success", FAILURE: "failure", FAULT: "failure" }[result.status] ?? "invalid";
  showRunStatus(statusClass, result.status);
  const panel = find("outcome");
  panel.hidden = false;
  panel.className = statusClass;
  const lines = [
    result.message,
    result.report ? `report: ${result.report}` : `record: ${result.run}`,
  ];
  panel.replaceChildren(...lines.filter(Boolean).map((line) => {
    const paragraph = document.createElement("p");
    paragraph.textContent = line;
    return paragraph;
  }));
}
