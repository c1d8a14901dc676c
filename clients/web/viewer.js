// SPDX-License-Identifier: Apache-2.0
// Draws the tiles of a map on a canvas and fetches again what a new revision changed.
'use strict';

const TILE_MAX_COUNT = 600;  // tiles kept in memory; those not drawn for longest go first
const ZOOM_MIN = 0;
const RETRY_MS = 1000;

const canvas = document.getElementById('canvas');
const context = canvas.getContext('2d');
const mapSelect = document.getElementById('map');
const stateText = document.getElementById('state');

let map = null;            // the answer of /maps/MAP
let layers = new Set(['occupancy']);
let revision = 0;          // of what is asked for
let events = null;
let tiles = new Map();     // 'layer/z/x/y' -> {image, loading, stale, used}
let view = {x: 0, y: 0, scale: 20};  // centre in metres, pixels per metre
let drawn = 0;             // counts frames: the age of a tile
let frameAsked = false;

const tileSideM = (zoom) => map.tile_side_at_zoom_0_m / 2 ** zoom;

function setState(text, kind) {
  stateText.textContent = text;
  stateText.className = kind;
}

function redraw() {
  if (!frameAsked) {
    frameAsked = true;
    requestAnimationFrame(draw);
  }
}

// ---- tiles ---------------------------------------------------------------------------------

function tileOf(layer, zoom, x, y) {
  const key = `${layer}/${zoom}/${x}/${y}`;
  let tile = tiles.get(key);
  if (!tile) {
    tile = {image: null, loading: false, stale: true, zoom, x, y};
    tiles.set(key, tile);
  }
  tile.used = drawn;
  if (tile.stale && !tile.loading) {
    load(tile, key);
  }
  return tile;
}

async function fetchTile(key) {
  const path = `/maps/${map.map}/tiles/${key}.png`;
  const pinned = await fetch(`${path}?revision=${revision}`);
  // A revision is kept for a while only; the newest is always there.
  return pinned.status === 404 ? fetch(path) : pinned;
}

async function load(tile, key) {
  const owner = tiles;
  tile.loading = true;
  tile.stale = false;
  try {
    const answer = await fetchTile(key);
    if (!answer.ok) {
      throw new Error(`${answer.status}`);
    }
    const image = await createImageBitmap(await answer.blob());
    if (tile.image) {
      tile.image.close();
    }
    tile.image = image;
  } catch (error) {
    setTimeout(() => { tile.stale = true; redraw(); }, RETRY_MS);
  }
  tile.loading = false;
  if (owner === tiles) {
    redraw();
  }
}

function forgetOldTiles() {
  if (tiles.size <= TILE_MAX_COUNT) {
    return;
  }
  const byAge = [...tiles].sort((a, b) => a[1].used - b[1].used);
  for (const [key, tile] of byAge.slice(0, tiles.size - TILE_MAX_COUNT)) {
    if (tile.used < drawn && !tile.loading) {
      tile.image?.close();
      tiles.delete(key);
    }
  }
}

// A tile at the change's zoom, its parents and its children look different now.
function markDirty(change) {
  const dirty = new Set(change.dirty_tiles.map(([x, y]) => `${x}/${y}`));
  const touched = (tile) => {
    if (change.everything_moved) {
      return true;
    }
    const levels = change.tile_zoom - tile.zoom;
    if (levels <= 0) {
      return dirty.has(`${Math.floor(tile.x / 2 ** -levels)}/${Math.floor(tile.y / 2 ** -levels)}`);
    }
    return change.dirty_tiles.some(([x, y]) =>
      Math.floor(x / 2 ** levels) === tile.x && Math.floor(y / 2 ** levels) === tile.y);
  };
  for (const tile of tiles.values()) {
    if (touched(tile)) {
      tile.stale = true;
    }
  }
}

// ---- drawing -------------------------------------------------------------------------------

function toScreen(x, y) {
  return [canvas.width / 2 + (x - view.x) * view.scale, canvas.height / 2 - (y - view.y) * view.scale];
}

function drawTile(tile) {
  const side = tileSideM(tile.zoom);
  const [left, top] = toScreen(tile.x * side, (tile.y + 1) * side);
  const [right, bottom] = toScreen((tile.x + 1) * side, tile.y * side);
  // Whole pixels: neighbours share the edge and no seam shows.
  const [x, y] = [Math.round(left), Math.round(top)];
  context.drawImage(tile.image, x, y, Math.round(right) - x, Math.round(bottom) - y);
}

// While a tile loads, the nearest parent that is there stands in for it.
function drawStandIn(layer, zoom, x, y) {
  for (let up = 1; up <= 6 && zoom - up >= ZOOM_MIN; ++up) {
    const parent = tiles.get(`${layer}/${zoom - up}/${Math.floor(x / 2 ** up)}/${Math.floor(y / 2 ** up)}`);
    if (parent?.image) {
      const side = 2 ** up;
      const size = parent.image.width / side;
      const column = x - parent.x * side;
      const row = side - 1 - (y - parent.y * side);
      const sideM = tileSideM(zoom);
      const [left, top] = toScreen(x * sideM, (y + 1) * sideM);
      context.drawImage(parent.image, column * size, row * size, size, size,
                        left, top, sideM * view.scale, sideM * view.scale);
      return;
    }
  }
}

function draw() {
  frameAsked = false;
  drawn += 1;
  canvas.width = Math.round(canvas.clientWidth * devicePixelRatio);
  canvas.height = Math.round(canvas.clientHeight * devicePixelRatio);
  context.fillStyle = '#cdcdcd';
  context.fillRect(0, 0, canvas.width, canvas.height);
  if (!map) {
    return;
  }
  const exact = Math.log2(view.scale * map.tile_side_at_zoom_0_m / map.tile_side_pixels);
  const zoom = Math.min(Math.max(Math.ceil(exact - 0.25), ZOOM_MIN), map.zoom_max);
  context.imageSmoothingEnabled = zoom > exact;
  const side = tileSideM(zoom);
  const halfWidth = canvas.width / view.scale / 2;
  const halfHeight = canvas.height / view.scale / 2;
  for (const layer of map.layers.filter((name) => layers.has(name))) {
    for (let x = Math.floor((view.x - halfWidth) / side); x * side < view.x + halfWidth; ++x) {
      for (let y = Math.floor((view.y - halfHeight) / side); y * side < view.y + halfHeight; ++y) {
        const tile = tileOf(layer, zoom, x, y);
        if (tile.image) {
          drawTile(tile);
        } else {
          drawStandIn(layer, zoom, x, y);
        }
      }
    }
  }
  drawOrigin();
  drawScale();
  forgetOldTiles();
}

function drawOrigin() {
  const [x, y] = toScreen(0, 0);
  const axis = (dx, dy, colour) => {
    context.strokeStyle = colour;
    context.lineWidth = 2 * devicePixelRatio;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + dx * view.scale, y - dy * view.scale);
    context.stroke();
  };
  axis(1, 0, '#d03030');
  axis(0, 1, '#2a8f3c');
}

function drawScale() {
  const longest = 120 * devicePixelRatio / view.scale;
  const power = 10 ** Math.floor(Math.log10(longest));
  const metres = [5, 2, 1].map((digit) => digit * power).find((length) => length <= longest);
  document.getElementById('bar').style.width = `${metres * view.scale / devicePixelRatio}px`;
  document.getElementById('bar-text').textContent = metres >= 1000 ? `${metres / 1000} km` : `${metres} m`;
}

// ---- moving about --------------------------------------------------------------------------

function fit() {
  const [xMin, yMin, xMax, yMax] = map?.bounds_m ?? [-10, -10, 10, 10];
  view.x = (xMin + xMax) / 2;
  view.y = (yMin + yMax) / 2;
  view.scale = 0.9 * Math.min(canvas.clientWidth / Math.max(xMax - xMin, 5),
                              canvas.clientHeight / Math.max(yMax - yMin, 5)) * devicePixelRatio;
  redraw();
}

function pointerInMap(event) {
  return [view.x + (event.clientX * devicePixelRatio - canvas.width / 2) / view.scale,
          view.y - (event.clientY * devicePixelRatio - canvas.height / 2) / view.scale];
}

function zoomAt([x, y], factor) {
  const scale = Math.min(Math.max(view.scale * factor, 0.02), 2000);
  view.x = x + (view.x - x) * view.scale / scale;
  view.y = y + (view.y - y) * view.scale / scale;
  view.scale = scale;
  redraw();
}

const pointers = new Map();
canvas.addEventListener('pointerdown', (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, event);
});
for (const name of ['pointerup', 'pointercancel']) {
  canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
}
canvas.addEventListener('pointermove', (event) => {
  const [x, y] = pointerInMap(event);
  document.getElementById('position').textContent = `${x.toFixed(2)}, ${y.toFixed(2)} m`;
  const before = pointers.get(event.pointerId);
  if (!before) {
    return;
  }
  const other = [...pointers.values()].find((pointer) => pointer.pointerId !== event.pointerId);
  if (other) {  // two fingers
    const distance = (pointer) => Math.hypot(pointer.clientX - other.clientX, pointer.clientY - other.clientY);
    zoomAt(pointerInMap(other), distance(event) / Math.max(distance(before), 1));
  } else {
    view.x -= (event.clientX - before.clientX) * devicePixelRatio / view.scale;
    view.y += (event.clientY - before.clientY) * devicePixelRatio / view.scale;
    redraw();
  }
  pointers.set(event.pointerId, event);
});
canvas.addEventListener('wheel', (event) => {
  event.preventDefault();
  zoomAt(pointerInMap(event), 2 ** (-event.deltaY / 300));
}, {passive: false});
canvas.addEventListener('keydown', (event) => {
  const step = 100 * devicePixelRatio / view.scale;
  const moves = {ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step]};
  if (moves[event.key]) {
    view.x += moves[event.key][0];
    view.y += moves[event.key][1];
    redraw();
  } else if (event.key === '+' || event.key === '-') {
    zoomAt([view.x, view.y], event.key === '+' ? 1.5 : 1 / 1.5);
  } else if (event.key === '0') {
    fit();
  }
});
window.addEventListener('resize', redraw);
document.getElementById('fit').addEventListener('click', async () => {
  await describe();
  fit();
});

// ---- maps and revisions --------------------------------------------------------------------

async function describe() {
  const answer = await fetch(`/maps/${mapSelect.value}`);
  if (!answer.ok) {
    throw new Error(await answer.text());
  }
  map = await answer.json();
}

function showRevision(number) {
  revision = number;
  document.getElementById('revision').textContent = `revision ${number}`;
}

function showLayers() {
  const box = document.getElementById('layers');
  box.replaceChildren(...map.layers.map((name) => {
    const label = document.createElement('label');
    const input = document.createElement('input');
    input.type = 'checkbox';
    input.checked = layers.has(name);
    input.addEventListener('change', () => {
      layers[input.checked ? 'add' : 'delete'](name);
      redraw();
    });
    label.append(input, ` ${name}`);
    return label;
  }));
}

function listen() {
  events?.close();
  events = new EventSource(`/maps/${map.map}/events`);
  events.onopen = () => setState('live', 'live');
  events.onerror = () => {
    setState('connection lost, trying again', 'lost');
    if (events.readyState === EventSource.CLOSED) {  // an answer that was no stream
      setTimeout(() => openMap(false), RETRY_MS);
    }
  };
  events.addEventListener('revision', (event) => {
    const change = JSON.parse(event.data);
    if (change.revision === revision) {  // the first event says again what the tiles show already
      return;
    }
    const first = !map.bounds_m;
    showRevision(change.revision);
    markDirty(change);
    redraw();
    if (first) {  // the map had nothing to look at until now
      describe().then(fit).catch(() => {});
    }
  });
  events.addEventListener('ended', () => {
    events.close();
    setTimeout(start, RETRY_MS);
  });
}

async function openMap(fitView) {
  try {
    await describe();
  } catch (error) {
    setState(error.message || 'no answer', 'lost');
    setTimeout(() => openMap(fitView), RETRY_MS);
    return;
  }
  tiles = new Map();
  location.hash = map.map;
  showRevision(map.revision);
  showLayers();
  listen();
  if (fitView) {
    fit();
  }
  redraw();
}

async function start() {
  try {
    const {maps} = await (await fetch('/maps')).json();
    if (maps.length === 0) {
      throw new Error('no map yet');
    }
    const wanted = location.hash.slice(1);
    mapSelect.replaceChildren(...maps.map(({map: name, state}) => {
      const option = new Option(state === 'serving' ? name : `${name} (${state})`, name);
      option.selected = name === wanted;
      return option;
    }));
    await openMap(true);
  } catch (error) {
    setState(error instanceof TypeError ? 'no answer from the server' : error.message, 'lost');
    setTimeout(start, RETRY_MS);
  }
}

mapSelect.addEventListener('change', () => openMap(true));
redraw();
start();
