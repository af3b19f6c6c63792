// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the page does in the browser: zoom, pan, layers, labels that do not collide, the panel of the chosen trunk.

namespace bole
{
constexpr const char *kReportStyle = R"(<style>
#board{display:grid;grid-template-columns:minmax(0,3fr) minmax(0,2fr);gap:1em}
@media(max-width:900px){#board{grid-template-columns:minmax(0,1fr)}}
#mapbox{position:relative;border:1px solid #ccc}
#map{display:block;width:100%;height:min(70vh,640px,100vw);touch-action:none;cursor:grab;background:#fff}
#map *{vector-effect:non-scaling-stroke}
#map text{paint-order:stroke;stroke:#fff;stroke-width:3px;fill:#222;pointer-events:none}
#map .reach{fill:transparent}
#map .trunk{cursor:pointer;outline:none}
#map .trunk:focus circle,#map .chosen circle{stroke:#000;stroke-width:2.5}
#map .reach{stroke:none!important}
#zoom{position:absolute;top:8px;right:8px;display:grid;gap:4px}
#scale{position:absolute;left:10px;bottom:10px;border:2px solid #222;border-top:0;font-size:12px;text-align:center;
  line-height:1.1;background:#fffa;pointer-events:none}
#legend{display:flex;flex-wrap:wrap;gap:.1em 1em;font-size:13px;margin:.4em 0}
#legend i{display:inline-block;width:14px;height:8px;margin:0 5px}
.panel{display:none}.panel.chosen{display:block}.panel h3{margin:.2em 0}
.view{float:right;margin:0 0 .5em .8em;max-width:55%}.view img{max-height:240px}
.banner{padding:.6em .9em;border-left:6px solid;background:#f6f6f6;margin:.6em 0}
.banner ul{margin:.3em 0;padding-left:1.2em}
tr[data-id]{cursor:pointer}tr.chosen td{background:#fde3d3}
</style>
)";

constexpr const char *kReportScript = R"(
(() => {
const map = document.getElementById('map');
const choose = id => {
  for (const e of document.querySelectorAll('.panel,.trunk,tr[data-id]'))
    e.classList.toggle('chosen', e.dataset.id === id);
};
for (const e of document.querySelectorAll('.trunk,tr[data-id]')) {
  e.addEventListener('click', () => choose(e.dataset.id));
  e.addEventListener('keydown', k => { if (k.key === 'Enter' || k.key === ' ') { k.preventDefault(); choose(e.dataset.id); } });
}
const first = document.querySelector('.panel');
if (first) choose(first.dataset.id);
if (!map) return;
const home = map.viewBox.baseVal, box = {x: home.x, y: home.y, w: home.width, h: home.height};
const whole = {...box}, scale = document.getElementById('scale'), labels = [...map.querySelectorAll('text')];
const circles = [...map.querySelectorAll('.trunk circle:not(.reach)')];
const perPixel = () => Math.max(box.w / map.clientWidth, box.h / map.clientHeight);
const show = () => {
  map.setAttribute('viewBox', [box.x, box.y, box.w, box.h].join(' '));
  const unit = perPixel();
  map.style.fontSize = 13 * unit + 'px';
  for (const t of labels) t.style.strokeWidth = 3 * unit + 'px', t.style.vectorEffect = 'none';
  const raw = unit * 150 / 100, base = 10 ** Math.floor(Math.log10(raw));
  const metres = base * (raw / base >= 5 ? 5 : raw / base >= 2 ? 2 : 1);
  scale.style.width = metres * 100 / unit + 'px';
  scale.textContent = +metres.toPrecision(3) + ' m';
  const halfW = map.clientWidth * unit / 2, halfH = map.clientHeight * unit / 2; // of what is to be seen
  const left = box.x + box.w / 2 - halfW, right = left + 2 * halfW, top = box.y + box.h / 2 - halfH, low = top + 2 * halfH;
  const taken = circles.map(c => c.getBBox()).map(b => // the square in the circle
    ({x: b.x + .15 * b.width, y: b.y + .15 * b.height, width: .7 * b.width, height: .7 * b.height}));
  taken.push({x: right - 50 * unit, y: top, width: 50 * unit, height: 120 * unit}); // the buttons
  for (const t of labels) { // at the first corner of its trunk that is free, or not at all
    const [x, y, r] = ['x', 'y', 'r'].map(k => +t.dataset[k]);
    t.style.display = '';
    const is_free = [[1, -1], [1, 1], [-1, -1], [-1, 1]].some(([side, down]) => {
      t.setAttribute('x', x + side * (r + 3 * unit));
      t.setAttribute('y', y + down * r + (down > 0 ? 10 * unit : 0));
      t.setAttribute('text-anchor', side > 0 ? 'start' : 'end');
      const b = t.getBBox();
      const hit = o => b.x < o.x + o.width && o.x < b.x + b.width && b.y < o.y + o.height && o.y < b.y + b.height;
      const is_cut = (x < right && b.x + b.width > right) || (x > left && b.x < left) || (y < low && b.y + b.height > low);
      return is_cut || taken.some(hit) ? false : taken.push(b);
    });
    if (!is_free) t.style.display = 'none';
  }
};
const zoom = (factor, x, y) => {
  const w = Math.min(Math.max(box.w * factor, whole.w / 200), whole.w * 4), f = w / box.w;
  box.x = x - (x - box.x) * f; box.y = y - (y - box.y) * f; box.w *= f; box.h *= f;
  show();
};
const place = (px, py) => {
  const p = new DOMPoint(px, py).matrixTransform(map.getScreenCTM().inverse());
  return [p.x, p.y];
};
map.addEventListener('wheel', e => { e.preventDefault(); zoom(Math.exp(e.deltaY * .0015), ...place(e.clientX, e.clientY)); },
                     {passive: false});
for (const b of document.querySelectorAll('#zoom button'))
  b.addEventListener('click', () => {
    if (+b.dataset.zoom) zoom(+b.dataset.zoom, box.x + box.w / 2, box.y + box.h / 2);
    else { Object.assign(box, whole); show(); }
  });
const fingers = new Map();
map.addEventListener('pointerdown', e => fingers.set(e.pointerId, [e.clientX, e.clientY]));
for (const end of ['pointerup', 'pointercancel', 'pointerleave'])
  map.addEventListener(end, e => fingers.delete(e.pointerId));
map.addEventListener('pointermove', e => {
  const before = fingers.get(e.pointerId);
  if (!before) return;
  const now = [e.clientX, e.clientY], others = [...fingers].filter(f => f[0] !== e.pointerId).map(f => f[1]);
  fingers.set(e.pointerId, now);
  if (others.length) {
    const far = p => Math.hypot(p[0] - others[0][0], p[1] - others[0][1]) || 1;
    zoom(far(before) / far(now), ...place((now[0] + others[0][0]) / 2, (now[1] + others[0][1]) / 2));
  } else {
    const unit = perPixel();
    box.x -= (now[0] - before[0]) * unit; box.y -= (now[1] - before[1]) * unit;
    show();
  }
});
for (const c of document.querySelectorAll('#legend input'))
  c.addEventListener('change', () => document.getElementById(c.dataset.layer).style.display = c.checked ? '' : 'none');
new ResizeObserver(show).observe(map);
show();
})();
)";
} // namespace bole
