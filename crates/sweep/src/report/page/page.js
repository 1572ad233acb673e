'use strict';
(() => {
const $ = id => document.getElementById(id);
const NS = 'http://www.w3.org/2000/svg';
let data = JSON.parse($('data').textContent);
const live = data.live;
const AXES = data.axes.map(a => a.key);
const AXIS = Object.fromEntries(data.axes.map(a => [a.key, a]));
const QUANTITIES = Object.fromEntries(data.quantities.map(q => [q.key, q.label]));
const hidden = new Set();
const chosenFilters = {};
let chosen = null;

const num = v => v === 'inf' ? Infinity : v;
const show = v => v === 'inf' || v === Infinity ? '∞' : v === null || v === undefined ? '–' : typeof v === 'number' ? String(+v.toPrecision(4)) : String(v);
const make = (tag, attributes = {}, text) => {
  const element = document.createElement(tag);
  for (const [k, v] of Object.entries(attributes)) element.setAttribute(k, v);
  if (text !== undefined) element.textContent = text;
  return element;
};
const draw = (tag, attributes = {}, text) => {
  const element = document.createElementNS(NS, tag);
  for (const [k, v] of Object.entries(attributes)) element.setAttribute(k, v);
  if (text !== undefined) element.textContent = text;
  return element;
};
/* Where the stress is imposed the rate is a result, and no axis tells points apart by it. */
const on = (point, axis) => axis === 'shear_rate' && point.shear_stress != null ? null : point[axis];
const values = axis => [...new Set(data.points.map(p => on(p, axis)))];
const varying = () => AXES.filter(axis => values(axis).length > 1);
const colour = n => `var(--c${n % 8})`;

function ticks(low, high, log) {
  if (log) {
    const all = [];
    const wide = Math.log10(high / low) > 2.5;
    for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++)
      for (const m of wide ? [1] : [1, 2, 5]) { const t = m * 10 ** e; if (t >= low * 0.999 && t <= high * 1.001) all.push(t); }
    return all;
  }
  const raw = (high - low) / 5 || 1, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find(m => m * power >= raw) * power;
  const all = [];
  for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9 * step; t += step) all.push(+t.toPrecision(12));
  return all;
}

/* A frame with axes; returns the maps from values to places. */
function frame(svg, width, height, x, y, labels) {
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const left = 58, right = 14, top = 14, bottom = 46;
  const fy = y.log ? Math.log : v => v;
  const X = v => left + (v - x.low) / (x.high - x.low || 1) * (width - left - right);
  const Y = v => height - bottom - (fy(v) - fy(y.low)) / (fy(y.high) - fy(y.low) || 1) * (height - top - bottom);
  for (const t of ticks(y.low, y.high, y.log)) {
    svg.append(draw('line', { class: 'grid', x1: left, x2: width - right, y1: Y(t), y2: Y(t) }));
    svg.append(draw('text', { x: left - 6, y: Y(t) + 4, 'text-anchor': 'end' }, String(+t.toPrecision(4))));
  }
  for (const t of x.ticks) {
    svg.append(draw('line', { class: 'axis', x1: X(t.at), x2: X(t.at), y1: height - bottom, y2: height - bottom + 5 }));
    svg.append(draw('text', { x: X(t.at), y: height - bottom + 19, 'text-anchor': 'middle' }, t.name));
  }
  svg.append(draw('rect', { class: 'axis', x: left, y: top, width: width - left - right, height: height - top - bottom }));
  svg.append(draw('text', { x: (left + width - right) / 2, y: height - 8, 'text-anchor': 'middle' }, labels[0]));
  svg.append(draw('text', { x: 14, y: (top + height - bottom) / 2, 'text-anchor': 'middle', transform: `rotate(-90 14 ${(top + height - bottom) / 2})` }, labels[1]));
  return { X, Y, left, right: width - right, top, bottom: height - bottom };
}
const narrow = () => window.matchMedia('(max-width: 40rem)').matches;

function curves() {
  const along = $('along').value, quantity = $('quantity').value;
  const shear = ['shear_rate', 'shear_stress'];
  const others = AXES.filter(a => a !== along && !(shear.includes(a) && shear.includes(along)));
  const distinguishing = varying().filter(a => others.includes(a));
  const groups = new Map();
  data.points.forEach((point, index) => {
    if (distinguishing.some(a => chosenFilters[a] !== undefined && chosenFilters[a] !== '' && String(on(point, a)) !== chosenFilters[a])) return;
    const key = along + (point.shear_stress != null) + JSON.stringify(others.map(a => on(point, a)));
    if (!groups.has(key)) groups.set(key, { key, label: distinguishing.map(a => `${AXIS[a].symbol} = ${show(on(point, a))}`).join(', ') || 'all runs', points: [] });
    groups.get(key).points.push({ index, x: num(point[along]), y: num(point[quantity]), half: point[quantity + '_ci95'] ?? null, point });
  });
  const list = [...groups.values()];
  list.forEach((curve, n) => {
    curve.colour = colour(n);
    curve.points = curve.points.filter(p => typeof p.y === 'number' && isFinite(p.y) && typeof p.x === 'number').sort((a, b) => a.x - b.x);
  });
  return list;
}

function xAxis(along, points) {
  if (AXIS[along].logarithmic) {
    const finite = points.map(p => p.x).filter(v => v > 0 && isFinite(v)).map(Math.log10);
    const low = finite.length ? Math.floor(Math.min(...finite)) : 0, high = finite.length ? Math.ceil(Math.max(...finite)) : 0;
    const place = v => v <= 0 ? low - 1 : v === Infinity ? high + 1 : Math.log10(v);
    const zero = points.some(p => p.x === 0), infinite = points.some(p => p.x === Infinity);
    const all = [];
    if (zero) all.push({ at: low - 1, name: '0' });
    for (let e = low; e <= high; e++) if (finite.length) all.push({ at: e, name: String(+(10 ** e).toPrecision(3)) });
    if (infinite) all.push({ at: high + 1, name: '∞' });
    return { place, low: low - (zero ? 1.4 : .4), high: high + (infinite ? 1.4 : .4), ticks: all, edges: [zero ? low - .5 : null, infinite ? high + .5 : null].filter(v => v !== null) };
  }
  const xs = points.map(p => p.x), span = Math.max(...xs) - Math.min(...xs) || 1;
  const low = Math.min(...xs) - .06 * span, high = Math.max(...xs) + .06 * span;
  return { place: v => v, low, high, ticks: ticks(low, high, false).map(t => ({ at: t, name: String(t) })), edges: [] };
}

function plot() {
  const svg = $('plot'), quantity = $('quantity').value, along = $('along').value, log = $('log').checked;
  const list = curves();
  const focused = document.activeElement?.dataset?.index;
  $('legend').replaceChildren(...list.map(curve => {
    const button = make('button', { type: 'button', 'aria-pressed': String(!hidden.has(curve.key)) });
    const swatch = make('span', { class: 'swatch', 'aria-hidden': 'true' });
    swatch.style.background = curve.colour;
    button.append(swatch, curve.label);
    button.onclick = () => { hidden.has(curve.key) ? hidden.delete(curve.key) : hidden.add(curve.key); const key = curve.key; plot(); [...$('legend').children][list.findIndex(c => c.key === key)]?.focus(); };
    return button;
  }));
  $('tip').hidden = true;
  const shown = list.filter(curve => !hidden.has(curve.key) && curve.points.length);
  const points = shown.flatMap(curve => curve.points).filter(p => !log || p.y > 0);
  if (!points.length) {
    svg.setAttribute('viewBox', '0 0 720 120');
    svg.replaceChildren(draw('text', { x: 360, y: 60, 'text-anchor': 'middle' }, data.points.length ? 'no results to draw yet' : 'this campaign has no points'));
    return;
  }
  const ends = points.flatMap(p => [p.y - (p.half ?? 0), p.y + (p.half ?? 0)]).concat(points.map(p => p.y));
  const dilutes = quantity.startsWith('viscosity') && along !== 'area_fraction' ? [...new Set(points.map(p => 1 + 5 * p.point.area_fraction / 3))] : [];
  const positive = ends.concat(dilutes).filter(v => v > 0);
  const y = log ? { log, low: Math.max(Math.min(...positive) * .9, Math.min(...points.map(p => p.y)) / 10), high: Math.max(...positive) * 1.1 } : (() => {
    const low = Math.min(...points.map(p => p.y)) < 0 ? Math.min(...ends) : 0, high = Math.max(0, ...ends, ...dilutes);
    return { log, low: low < 0 ? low * 1.06 : 0, high: high * 1.06 || 1 };
  })();
  const x = xAxis(along, points);
  const width = narrow() ? 400 : 820, height = narrow() ? 340 : 440;
  const { X, Y, left, right, top, bottom } = frame(svg, width, height, x, y, [AXIS[along].label, QUANTITIES[quantity]]);
  for (const d of dilutes) svg.append(draw('line', { class: 'dilute', x1: left, x2: right, y1: Y(d), y2: Y(d) }));
  for (const e of x.edges) svg.append(draw('line', { class: 'edge', x1: X(e), x2: X(e), y1: top, y2: bottom }));
  let number = 0;
  for (const curve of shown) {
    const drawn = curve.points.filter(p => !log || p.y > 0);
    svg.append(draw('polyline', { class: 'curve', points: drawn.map(p => `${X(x.place(p.x))},${Y(p.y)}`).join(' '), fill: 'none', style: `stroke:${curve.colour}`, 'stroke-width': 2 }));
    for (const p of drawn) {
      const cx = X(x.place(p.x)), cy = Y(p.y);
      const group = draw('g', { class: chosen === p.index ? 'point chosen' : 'point', tabindex: number++ ? '-1' : '0', role: 'button', 'data-index': p.index });
      const text = `${curve.label}\n${AXIS[along].symbol} = ${show(p.x)}\n${QUANTITIES[quantity]} ${show(p.y)}${p.half !== null ? ` ± ${show(p.half)}` : ''}\n${p.point.seeds} runs${p.point.jammed ? `, ${p.point.jammed} jammed` : ''}${p.point.failed ? `, ${p.point.failed} failed` : ''}${p.point.doubtful ? `, ${p.point.doubtful} doubtful` : ''}`;
      group.setAttribute('aria-label', text.replaceAll('\n', ', '));
      if (p.half) {
        const upper = Y(p.y + p.half), lower = Y(Math.max(p.y - p.half, y.low));
        group.append(draw('path', { d: `M${cx} ${upper}V${lower}M${cx - 4} ${upper}h8M${cx - 4} ${lower}h8`, fill: 'none', style: `stroke:${curve.colour}`, 'stroke-width': 1.5 }));
      }
      group.append(draw('circle', { cx, cy, r: 4.5, style: `fill:${curve.colour}` }), draw('circle', { class: 'halo', cx, cy, r: 11 }));
      const hint = () => {
        const tip = $('tip'), box = svg.getBoundingClientRect();
        tip.textContent = text; tip.hidden = false;
        const px = cx / width * box.width, py = cy / height * box.height;
        tip.style.left = Math.max(0, Math.min(px + 12, box.width - tip.offsetWidth)) + 'px';
        tip.style.top = Math.max(0, py - tip.offsetHeight - 10) + 'px';
      };
      group.onmouseenter = group.onfocus = hint;
      group.onmouseleave = group.onblur = () => { $('tip').hidden = true; };
      group.onclick = () => choose(p.index);
      group.onkeydown = event => {
        if (event.key === 'Enter' || event.key === ' ') { event.preventDefault(); choose(p.index); return; }
        const all = [...svg.querySelectorAll('.point')], at = all.indexOf(group);
        const next = { ArrowRight: at + 1, ArrowDown: at + 1, ArrowLeft: at - 1, ArrowUp: at - 1, Home: 0, End: all.length - 1 }[event.key];
        if (next !== undefined && all[next]) { event.preventDefault(); all.forEach(o => o.setAttribute('tabindex', '-1')); all[next].setAttribute('tabindex', '0'); all[next].focus(); }
      };
      svg.append(group);
    }
  }
  if (focused !== undefined) svg.querySelector(`[data-index="${CSS.escape(focused)}"]`)?.focus();
}

/* The runs of a point. */
function choose(index, quietly) {
  chosen = index;
  const point = data.points[index];
  $('runs').hidden = false;
  $('point').textContent = varying().concat(varying().length ? [] : ['area_fraction', 'shear_rate']).map(a => `${AXIS[a].symbol} = ${show(point[a])}`).join(', ');
  const runs = data.runs.filter(run => run.point === index);
  const traced = runs.filter(run => run.trace.length > 1);
  const svg = $('trace');
  if (traced.length) {
    const all = traced.flatMap(run => run.trace), ys = all.map(p => p[1]), xs = all.map(p => p[0]);
    const lowest = Math.min(...ys), highest = Math.max(...ys), log = lowest > 0 && highest > 10 * lowest;
    const x = { low: 0, high: Math.max(...xs), ticks: ticks(0, Math.max(...xs), false).map(t => ({ at: t, name: String(t) })) };
    const width = narrow() ? 400 : 820, height = narrow() ? 260 : 280;
    const { X, Y } = frame(svg, width, height, x, { log, low: log ? lowest * .9 : Math.min(0, lowest), high: highest * 1.06 }, ['strain', 'viscosity']);
    traced.forEach((run, n) => svg.append(draw('polyline', { class: 'run', points: run.trace.map(p => `${X(p[0]).toFixed(1)},${Y(p[1]).toFixed(1)}`).join(' '), fill: 'none', style: `stroke:${colour(n)}`, 'stroke-width': 1.2 })));
  } else {
    svg.setAttribute('viewBox', '0 0 720 60');
    svg.replaceChildren(draw('text', { x: 360, y: 34, 'text-anchor': 'middle' }, 'no samples yet'));
  }
  const table = make('table');
  const head = make('tr');
  for (const name of ['', 'seed', 'key', 'state', 'viscosity', 'time / s', 'movie']) head.append(make('th', { scope: 'col' }, name));
  table.append(head);
  for (const run of runs) {
    const row = make('tr'), place = traced.indexOf(run), first = make('td');
    if (place >= 0) { const swatch = make('span', { class: 'swatch', 'aria-hidden': 'true' }); swatch.style.background = colour(place); first.append(swatch); }
    row.append(first, make('td', {}, run.seed), make('td', { class: 'name' }, run.key.slice(0, 10)), make('td', {}, run.state), make('td', {}, show(run.viscosity)), make('td', {}, show(run.wall_time_s)));
    const cell = make('td');
    if (data.movies[run.key]) {
      const button = make('button', { type: 'button' }, 'watch');
      button.onclick = async () => { await watch(run); $('movie').scrollIntoView({ block: 'nearest' }); };
      cell.append(button);
    } else cell.textContent = '–';
    row.append(cell);
    table.append(row);
  }
  $('run-list').replaceChildren(table);
  if (!quietly) {
    const first = runs.find(run => data.movies[run.key]);
    if (first) watch(first); else { stop(); $('movie').hidden = true; }
    plot();
    document.querySelector(`#plot [data-index="${index}"]`)?.focus({ preventScroll: true });
    $('runs').scrollIntoView({ block: 'nearest' });
  }
}

/* The movie of a run. */
let movie = null, at = 0, timer = null;
function stop() { clearInterval(timer); timer = null; $('play').textContent = 'Play'; $('play').setAttribute('aria-pressed', 'false'); }
async function watch(run) {
  stop();
  let film = data.movies[run.key];
  if (film === true) {
    const answer = await fetch('movie/' + encodeURIComponent(run.key)).catch(() => null);
    if (!answer?.ok) return;
    film = await answer.json();
  }
  movie = film; at = 0;
  $('movie').hidden = false;
  $('movie-name').textContent = `of the run with seed ${run.seed}`;
  $('scrub').max = movie.frames.length - 1;
  picture();
}
function picture() {
  if (!movie) return;
  const canvas = $('layer'), pen = canvas.getContext('2d'), f = movie.frames[at], side = movie.side;
  const style = getComputedStyle(document.documentElement), ink = name => style.getPropertyValue(name).trim();
  const scale = canvas.width / side;
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.setTransform(scale, 0, 0, -scale, 0, canvas.height);
  const n = f.x.length / 3, radius = i => movie.radii[movie.radii.length === 1 ? 0 : i];
  const wrap = (x, y) => { const rows = Math.floor(y / side); x -= rows * f.offset; y -= rows * side; return [x - Math.floor(x / side) * side, y]; };
  const images = (x, y, reach, paint) => {
    for (let row = -1; row <= 1; row++) for (let column = -2; column <= 2; column++) {
      const px = x + column * side + row * f.offset, py = y + row * side;
      if (px > -reach && px < side + reach && py > -reach && py < side + reach) paint(px, py);
    }
  };
  pen.lineWidth = .06; pen.strokeStyle = ink('--soft');
  for (let i = 0; i < n; i++) {
    const [x, y] = wrap(f.x[3 * i], f.x[3 * i + 1]), angle = f.x[3 * i + 2], a = radius(i);
    images(x, y, a, (px, py) => {
      pen.beginPath(); pen.arc(px, py, a, 0, 7); pen.fillStyle = ink('--paper'); pen.fill(); pen.stroke();
      pen.beginPath(); pen.moveTo(px + .35 * a * Math.cos(angle), py + .35 * a * Math.sin(angle)); pen.lineTo(px + .85 * a * Math.cos(angle), py + .85 * a * Math.sin(angle)); pen.stroke();
    });
  }
  const colours = [ink('--soft'), ink('--c0'), ink('--c1')];
  pen.lineCap = 'round';
  for (const [i, j, state, nx, ny, force] of f.contacts) {
    const [x, y] = wrap(f.x[3 * i], f.x[3 * i + 1]), r = radius(i) + radius(j);
    pen.strokeStyle = colours[state]; pen.lineWidth = Math.min(.06 + .34 * force / movie.force, .55);
    images(x, y, 2 * r, (px, py) => { pen.beginPath(); pen.moveTo(px, py); pen.lineTo(px + r * nx, py + r * ny); pen.stroke(); });
  }
  $('scrub').value = at;
  $('scrub').setAttribute('aria-valuetext', `strain ${f.strain.toFixed(2)}`);
  $('strain').textContent = `${f.strain.toFixed(2)}, ${f.contacts.length} contacts`;
}
$('play').onclick = () => {
  if (timer) { stop(); return; }
  $('play').textContent = 'Pause'; $('play').setAttribute('aria-pressed', 'true');
  timer = setInterval(() => { at = (at + 1) % movie.frames.length; picture(); }, 80);
};
$('scrub').oninput = () => { stop(); at = +$('scrub').value; picture(); };

/* Everything that is not a curve. */
function words() {
  const c = data.cases, total = c.done + c.jammed + c.failed + c.running + c.pending;
  document.title = `${data.campaign} · sweep`;
  $('name').textContent = data.campaign;
  const eta = data.eta_s !== null && data.eta_s !== undefined ? `, about ${data.eta_s < 90 ? Math.round(data.eta_s) + ' s' : data.eta_s < 5400 ? Math.round(data.eta_s / 60) + ' min' : (data.eta_s / 3600).toFixed(1) + ' h'} left` : '';
  $('summary').textContent = `${c.done} of ${total} runs done, ${c.jammed} jammed, ${c.failed} failed, ${c.running} running, ${c.pending} pending${eta}. Strain discarded: ${data.discard}.${data.selection ? ` Only where ${data.selection}.` : ''}${data.doubtful ? ` ${data.doubtful} finished runs have doubtful numbers${data.with_doubtful ? ', averaged with the others' : ', not averaged'}.` : ''}`;
  $('progress').value = data.work_done;
  const axes = varying();
  const columns = (axes.length ? axes : ['area_fraction', 'shear_rate']).map(a => [AXIS[a].symbol, p => show(p[a])]).concat([['runs', p => p.seeds], ['jammed', p => p.jammed], ['failed', p => p.failed], ['doubtful', p => p.doubtful]], Object.entries(QUANTITIES).map(([q, name]) => [name, p => show(p[q]) + (p[q + '_ci95'] != null ? ` ± ${show(+p[q + '_ci95'].toPrecision(2))}` : '')]));
  const head = make('tr');
  for (const [name] of columns) head.append(make('th', { scope: 'col' }, name));
  $('points').replaceChildren(head, ...data.points.map(p => { const row = make('tr'); for (const [, cell] of columns) row.append(make('td', {}, cell(p))); return row; }));
  $('failures-section').hidden = !data.failures.length;
  $('failures').replaceChildren(...data.failures.map(f => make('li', {}, `${f.key.slice(0, 10)}, seed ${f.seed}, strain ${f.strain.toFixed(3)}: ${f.error}`)));
  $('provenance').replaceChildren(...data.provenance.map(p => make('li', {}, `sweep ${p.version}, physics ${p.physics_version}, build ${p.build.slice(0, 12)} on ${p.host}, ${p.threads} threads, ${p.results} results, begun ${new Date(p.started_at).toISOString().slice(0, 16).replace('T', ' ')} UTC`)));
  $('text').textContent = data.text;
}
function controls() {
  const keep = (select, options, preferred) => {
    const before = select.value;
    select.replaceChildren(...options.map(([value, name]) => make('option', { value }, name)));
    select.value = options.some(o => o[0] === before) ? before : options.some(o => o[0] === preferred) ? preferred : options[0]?.[0];
  };
  keep($('quantity'), Object.entries(QUANTITIES), 'viscosity');
  const numeric = varying().filter(a => AXIS[a].numeric);
  keep($('along'), (numeric.length ? numeric : ['shear_rate']).map(a => [a, AXIS[a].symbol]), 'shear_rate');
  filters();
}
function filters() {
  const along = $('along').value;
  $('filters').replaceChildren(...varying().filter(a => a !== along).map(axis => {
    const label = make('label', {}, AXIS[axis].symbol + ' '), select = make('select', { 'data-axis': axis });
    select.append(make('option', { value: '' }, 'all'), ...values(axis).map(v => make('option', { value: String(v) }, show(v))));
    select.value = chosenFilters[axis] ?? '';
    select.onchange = () => { chosenFilters[axis] = select.value; plot(); };
    label.append(select);
    return label;
  }));
}
$('quantity').onchange = plot;
$('along').onchange = () => { for (const key in chosenFilters) delete chosenFilters[key]; filters(); plot(); };
$('log').onchange = plot;
window.matchMedia('(max-width: 40rem)').addEventListener('change', () => { plot(); if (chosen !== null) choose(chosen, true); });
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', picture);
const spread = data.points.map(p => p.viscosity).filter(v => v > 0);
$('log').checked = spread.length > 1 && Math.max(...spread) > 10 * Math.min(...spread);
words(); controls(); plot();

if (live) {
  const again = async () => {
    try {
      const answer = await fetch('data.json', { cache: 'no-store' });
      if (!answer.ok) throw new Error(String(answer.status));
      const structure = JSON.stringify(data.points.map(p => AXES.map(a => p[a])));
      data = await answer.json();
      if (structure !== JSON.stringify(data.points.map(p => AXES.map(a => p[a])))) { chosen = null; controls(); }
      words();
      if (!document.activeElement?.closest?.('#legend, #filters')) plot();
      if (chosen !== null) choose(chosen, true);
    } catch {
      $('summary').textContent = 'The server no longer answers; what is shown is the last state it told.';
    }
    setTimeout(again, 3000);
  };
  setTimeout(again, 3000);
}
})();
