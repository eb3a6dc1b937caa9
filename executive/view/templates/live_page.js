"use strict";
// Shows the messages of the server, and sends commands of the user to it.

const SVG = "http://www.w3.org/2000/svg";
const STATUS_CLASSES = ["running", "success", "failure", "invalid"];
const CLASS_COLOURS = ["#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00"];
const SCROLL_PERIOD = 400; // minimum time between two scrolls of the tree [ms]
const MAX_TARGET_DISTANCE = 0.03; // maximum distance between the target and its detection [m]

const getElement = (id) => document.getElementById(id);
const state = { nodes: {}, items: {}, is_paused: false, has_ended: false }; // all values that the server sent
const nodeGroups = new Map(); // SVG group of each node, by the path of the node
const detectedClasses = []; // object classes in the order of their first detection
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
getElement("whole").onchange = () => document.querySelector("#tree .scroll").classList.toggle("whole", getElement("whole").checked);
for (const command of ["pause", "resume", "step", "stop"]) getElement(command).onclick = () => send({ name: command });

function send(command) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
}

function rendersOnCpu() {
  const context = document.createElement("canvas").getContext("webgl");
  const extension = context && context.getExtension("WEBGL_debug_renderer_info");
  return !extension || /swiftshader|llvmpipe|software/i.test(context.getParameter(extension.UNMASKED_RENDERER_WEBGL));
}

function applyChanges(changes) {
  const { nodes, items, ...values } = changes;
  Object.assign(state, values);
  if ("tree" in changes) showTree(changes.tree);
  for (const [path, node] of Object.entries(nodes ?? {})) {
    state.nodes[path] = node;
    showNodeStatus(path, node);
    // A failure of a control node only repeats the failure of a skill.
    const group = nodeGroups.get(path);
    if (node.status === "failure" && node.failure && group?.classList.contains("skill")) {
      getElement("message").textContent = `${path.split("/").pop().split(":").pop()}: ${node.failure}`;
    }
  }
  Object.assign(state.items, items);
  // The objects of an emptied bin are forgotten.
  for (const [name, item] of Object.entries(items ?? {})) if (!item) delete state.items[name];
  if ("run" in changes) {
    getElement("mission").textContent = `${changes.run.mission}, seed ${changes.run.seed}`;
    document.title = `${changes.run.mission} · executive`;
  }
  if ("clock" in changes) getElement("clock").textContent = `${changes.clock.toFixed(1)} s`;
  if (items) showItems();
  if ("look" in changes || "decision" in changes || (items && state.look)) showCamera();
  if ("choices" in changes) showButtons("request", "request", changes.choices && [...changes.choices, "rescan", "quit"]);
  if (changes.note) getElement("message").textContent = changes.note;
  if (nodes) scrollToRunningSkill();
  if ("result" in changes) showResult(changes.result);
  else if (!state.result) {
    const status = state.is_paused ? "paused" : state.choices ? "waiting for a request" : "running";
    showRunStatus(state.has_ended ? "invalid" : "running", state.has_ended ? "ending" : status);
  }
  getElement("pause").disabled = state.is_paused || state.has_ended;
  getElement("resume").disabled = !state.is_paused || state.has_ended;
  getElement("step").disabled = getElement("stop").disabled = state.has_ended;
}

function showRunStatus(statusClass, text) {
  getElement("head").className = statusClass;
  getElement("status").textContent = text;
}

function showTree(svg) {
  const tree = document.importNode(new DOMParser().parseFromString(svg, "image/svg+xml").documentElement, true);
  document.querySelector("#tree .scroll").replaceChildren(tree);
  nodeGroups.clear();
  for (const group of tree.querySelectorAll("g.node")) nodeGroups.set(group.dataset.path, group);
  for (const [path, node] of Object.entries(state.nodes)) showNodeStatus(path, node);
}

function showNodeStatus(path, node) {
  const group = nodeGroups.get(path);
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

function scrollToRunningSkill() {
  const now = performance.now();
  if (!getElement("follow").checked || now - lastScrollTime < SCROLL_PERIOD) return;
  const isRunningSkill = (group) => group.classList.contains("skill") && group.classList.contains("running");
  const target = [...nodeGroups.values()].find(isRunningSkill);
  if (!target) return;
  lastScrollTime = now;
  const container = document.querySelector("#tree .scroll");
  const box = target.querySelector(".box").getBoundingClientRect();
  const view = container.getBoundingClientRect();
  const isVisible = box.left >= view.left && box.right <= view.right && box.top >= view.top && box.bottom <= view.bottom;
  if (isVisible) return;
  // An animated scroll of a large drawing would slow down the run.
  container.scrollTo({
    left: container.scrollLeft + box.left - view.left - 0.62 * view.width,
    top: container.scrollTop + box.top - view.top - 0.4 * view.height,
  });
}

function showItems() {
  const rows = Object.values(state.items).filter((item) => item.state !== "phantom");
  const bins = [...new Set(rows.filter((item) => item.state === "placed").map((item) => item.bin))].sort();
  const shownBins = [...getElement("bins").querySelectorAll("button")].map((button) => button.textContent);
  if (bins.join() !== shownBins.join()) showButtons("bins", "empty_bins", bins);
  getElement("items").querySelector("tbody").replaceChildren(...rows.map((item) => {
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
  getElement("frame").textContent = `${look.camera}, frame ${look.frame} at ${look.stamp.toFixed(2)} s, by ${look.detector}`;
}

function drawDetection(detection, isTarget) {
  const [left, top, right, bottom] = detection.box;
  if (!detectedClasses.includes(detection.label)) detectedClasses.push(detection.label);
  const colour = CLASS_COLOURS[detectedClasses.indexOf(detection.label) % CLASS_COLOURS.length];
  const box = makeElement("rect", { x: left, y: top, width: right - left, height: bottom - top, class: isTarget ? "target" : "" });
  box.style.stroke = colour;
  const label = makeElement("text", { x: left, y: top - 4 });
  label.textContent = `${isTarget ? state.decision.item : detection.label} ${detection.confidence.toFixed(2)}`;
  label.style.fill = colour;
  return [box, label];
}

// Return the index of the detection nearest to the selected target, or -1.
function findTarget(look) {
  const item = state.decision && state.items[state.decision.item];
  if (!item || !item.position || item.state === "placed") return -1;
  const [itemX, itemY] = item.position;
  const distances = look.detections.map(({ position }) => (position ? Math.hypot(position[0] - itemX, position[1] - itemY) : Infinity));
  const minDistance = Math.min(...distances);
  return minDistance < MAX_TARGET_DISTANCE ? distances.indexOf(minDistance) : -1;
}

function makeElement(tag, attributes) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

// Show a button for each text, which sends a command with the text; hide the panel if there are no texts.
function showButtons(id, name, texts) {
  const panel = getElement(id);
  panel.hidden = !texts?.length;
  for (const button of panel.querySelectorAll("button")) button.remove();
  for (const text of texts ?? []) {
    const button = panel.appendChild(document.createElement("button"));
    button.textContent = text;
    button.onclick = () => send({ name, text });
  }
}

function showResult(result) {
  const statusClass = { SUCCESS: "success", FAILURE: "failure", FAULT: "failure" }[result.status] ?? "invalid";
  showRunStatus(statusClass, result.status);
  const panel = getElement("outcome");
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
