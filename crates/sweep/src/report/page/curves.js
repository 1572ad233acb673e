/* Views of the points as curves: a quantity against an axis, the flow curve, the contacts. */

/* The series of a view: name, value at a point, half-width of its interval. */
const SERIES = {
  curve: () => { const q = $('quantity').value; return [['', p => p[q], p => p[q + '_ci95'] ?? null]]; },
  flow: () => [['', p => p.stress, p => p.stress_ci95]],
  contacts: () => [
    ['in contact', p => p.contacts_per_sphere, () => null],
    ['activated', p => activated(p), () => null],
    ['rolling', p => activated(p) * (p.rolling_fraction ?? 0), () => null],
    ['slipping', p => activated(p) * (1 - (p.rolling_fraction ?? 0)), () => null],
  ],
};
const activated = p => p.contacts_per_sphere == null ? null : p.contacts_per_sphere * (p.activated_fraction ?? 0);
const along_of = view => view === 'flow' ? 'shear_rate' : $('along').value;
const label_of = view => ({ curve: QUANTITIES[$('quantity').value], flow: data.stress_label, contacts: 'pairs per sphere' })[view];
/* Whether a point passes the filters. */
const meets = (point, axes) => !axes.some(a => chosenFilters[a] && String(on(point, a)) !== chosenFilters[a]);

function curves(view) {
  const along = along_of(view);
  const shear = ['shear_rate', 'shear_stress'];
  const others = AXES.filter(a => a !== along && !(shear.includes(a) && shear.includes(along)));
  const distinguishing = varying().filter(a => others.includes(a));
  const groups = new Map();
  const series = SERIES[view]();
  data.points.forEach((point, index) => {
    if (!meets(point, distinguishing)) return;
    const name = name_of(point, distinguishing);
    series.forEach(([what, value, half]) => {
      const key = what + along + (point.shear_stress != null) + JSON.stringify(others.map(a => on(point, a)));
      if (!groups.has(key)) groups.set(key, { key, label: [what, name].filter(w => w).join(', ') || 'all runs', points: [] });
      groups.get(key).points.push({ index, x: num(point[along]), y: num(value(point)), half: half(point), point });
    });
  });
  const list = [...groups.values()];
  list.forEach((curve, n) => {
    Object.assign(curve, { n, colour: colour(n, list.length) });
    curve.points = curve.points.filter(p => typeof p.x === 'number').sort((a, b) => a.x - b.x);
  });
  return list;
}

function horizontal(along, points) {
  if (AXIS[along].logarithmic) {
    const finite = points.map(p => p.x).filter(v => v > 0 && isFinite(v)).map(Math.log10);
    const low = finite.length ? Math.floor(Math.min(...finite)) : 0, high = finite.length ? Math.ceil(Math.max(...finite)) : 0;
    const place = v => v <= 0 ? low - 1 : v === Infinity ? high + 1 : Math.log10(v);
    const zero = points.some(p => p.x === 0), infinite = points.some(p => p.x === Infinity);
    const list = [];
    for (let e = low; e <= high; e++) if (finite.length) list.push(e);
    const names = decades(list), all = list.map((e, n) => ({ at: e, name: names[n] }));
    if (zero) all.unshift({ at: low - 1, name: '0' });
    if (infinite) all.push({ at: high + 1, name: '∞' });
    return { place, low: low - (zero ? 1.4 : .4), high: high + (infinite ? 1.4 : .4), ticks: all, edges: [zero ? low - .5 : null, infinite ? high + .5 : null].filter(v => v !== null) };
  }
  const xs = points.map(p => p.x), span = Math.max(...xs) - Math.min(...xs) || 1;
  return linear(Math.min(...xs) - .06 * span, Math.max(...xs) + .06 * span);
}

/* Buttons that show and hide curves. */
function legend(list, redraw) {
  $('legend').replaceChildren(...list.map(curve => {
    const button = make('button', { type: 'button', 'aria-pressed': String(!hidden.has(curve.key)) });
    button.append(swatch(curve.n, curve.colour, curve.plain), curve.label);
    button.onclick = () => {
      hidden.has(curve.key) ? hidden.delete(curve.key) : hidden.add(curve.key);
      redraw();
      [...$('legend').children][list.findIndex(c => c.key === curve.key)]?.focus();
    };
    return button;
  }));
}

function plot_curves(view) {
  const svg = $('plot'), along = along_of(view), log = $('log').checked;
  const list = curves(view), label = label_of(view);
  legend(list, plot);
  const is_number = p => typeof p.y === 'number' && isFinite(p.y);
  const shown = list.filter(curve => !hidden.has(curve.key) && curve.points.some(is_number));
  const all = shown.flatMap(curve => curve.points).filter(is_number);
  const points = all.filter(p => !log || p.y > 0);
  shown_table = { head: ['curve', AXIS[along].key, label, 'half-width of 95 % interval', 'trend'], rows: shown.flatMap(c => c.points.filter(is_number).map(p => [c.label, p.x, p.y, p.half, trend_of(p.point)])) };
  if (log && points.length < all.length) $('remark').textContent = `${all.length - points.length} of ${all.length} values are 0 or negative and cannot be shown on a logarithmic axis.`;
  if (!points.length) {
    nothing(svg, all.length ? 'no positive values: switch off the logarithmic axis' : data.points.length ? 'no results yet' : 'this campaign has no points');
    return;
  }
  const ends = points.flatMap(p => [p.y - (p.half ?? 0), p.y + (p.half ?? 0), p.y]);
  const is_viscosity = view === 'curve' && $('quantity').value.startsWith('viscosity');
  const dilutes = is_viscosity && !is_fraction(along) ? [...new Set(points.map(p => data.viscosity_factor * dilute(p.point)))] : [];
  const positive = ends.concat(dilutes).filter(v => v > 0);
  const y = log ? { log, low: Math.max(Math.min(...positive) * .9, Math.min(...points.map(p => p.y)) / 10), high: Math.max(...positive) * 1.1 } : (() => {
    const low = Math.min(...points.map(p => p.y)) < 0 ? Math.min(...ends) : 0, high = Math.max(0, ...ends, ...dilutes);
    return { log, low: low < 0 ? low * 1.06 : 0, high: high * 1.06 || 1 };
  })();
  const x = horizontal(along, points);
  const width = narrow() ? 400 : 820, height = narrow() ? 340 : 440;
  const { X, Y, left, right, top, bottom } = frame(svg, width, height, x, y, [AXIS[along].label, label]);
  dilutes.forEach((d, n) => {
    svg.append(draw('line', { class: 'dilute', x1: left, x2: right, y1: Y(d), y2: Y(d) }));
    if (!n) svg.append(draw('text', { class: 'aside', x: right - 4, y: Y(d) + (bottom - Y(d) > 22 ? 14 : -5), 'text-anchor': 'end' }, points.some(p => p.point.volume_fraction) ? 'dilute 1 + 5φ/2' : 'dilute 1 + 5c/3'));
  });
  for (const e of x.edges) svg.append(draw('line', { class: 'edge', x1: X(e), x2: X(e), y1: top, y2: bottom }));
  const bands = $('bands').checked;
  /* Error bars of several curves at the same value are drawn side by side. */
  const barred = bands ? [] : shown.filter(c => c.points.some(p => p.half));
  const behind = draw('g', { class: 'bands' });
  svg.append(behind);
  let lost = 0;
  for (const curve of shown) {
    const dodge = barred.length > 1 ? (barred.indexOf(curve) - (barred.length - 1) / 2) * Math.min(6, 30 / barred.length) : 0;
    const group = draw('g', { class: 'curve' });
    /* Pieces of the line: it is interrupted at a break of the axis and at a point without a result. */
    const pieces = [[]];
    let before = null;
    for (const p of curve.points) {
      if (!is_number(p)) {
        pieces.push([]);
        if (!p.point.seeds) { lost++; group.append(draw('path', { class: 'lost', d: 'M-4-4L4 4M-4 4L4-4', transform: `translate(${X(x.place(p.x)) + dodge} ${bottom - 8})`, style: `stroke:${curve.colour}` })); }
        continue;
      }
      if (log && p.y <= 0) { pieces.push([]); continue; }
      if (before !== null && x.edges.some(e => e > x.place(before) && e < x.place(p.x))) pieces.push([]);
      pieces.at(-1).push(p);
      before = p.x;
    }
    const low = p => Math.max(p.y - (p.half ?? 0), y.low);
    for (const piece of pieces.filter(piece => piece.length)) {
      const at = (p, v, shift = 0) => `${X(x.place(p.x)) + dodge + shift},${Y(v)}`;
      if (bands && piece.some(p => p.half)) {
        const wide = piece.length > 1 ? 0 : 6, upper = piece.map(p => at(p, p.y + (p.half ?? 0), -wide)), lower = piece.map(p => at(p, low(p), -wide)).reverse();
        if (wide) { upper.push(at(piece[0], piece[0].y + piece[0].half, wide)); lower.unshift(at(piece[0], low(piece[0]), wide)); }
        behind.append(draw('polygon', { class: 'band', points: upper.concat(lower).join(' '), style: `fill:${curve.colour}` }));
      }
      if (piece.length > 1) group.append(draw('polyline', { points: piece.map(p => at(p, p.y)).join(' '), fill: 'none', style: `stroke:${curve.colour}`, 'stroke-width': 2 }));
    }
    svg.append(group);
    for (const p of pieces.flat()) {
      const cx = X(x.place(p.x)) + dodge, cy = Y(p.y);
      const group = draw('g', { class: chosen === p.index ? 'point chosen' : 'point', 'data-index': p.index });
      if (p.half && !bands) {
        const upper = Y(p.y + p.half), lower = Y(low(p));
        group.append(draw('path', { d: `M${cx} ${upper}V${lower}M${cx - 4} ${upper}h8M${cx - 4} ${lower}h8`, fill: 'none', style: `stroke:${curve.colour}`, 'stroke-width': 1.5 }));
      }
      if (p.point.ordering) group.append(draw('rect', { class: 'trend', x: cx - 8, y: cy - 8, width: 16, height: 16 }));
      else if (p.point.not_steady) group.append(draw('circle', { class: 'trend', cx, cy, r: 8 }));
      group.append(marker(curve.n, cx, cy, 4.5, curve.colour), draw('circle', { class: 'halo', cx, cy, r: 11 }));
      const text = `${curve.label}\n${AXIS[along].symbol} = ${value_in(along, p.x)}\n${label} ${with_half(p.y, p.half)}\n${of_runs(p.point)}`;
      walkable(svg, group, text, [cx, cy], width, () => choose(p.index));
    }
  }
  $('note').textContent = `Means over runs with 95 % intervals. Γ = 0 and Γ = ∞ are drawn at the edges.${lost ? ' A cross on the axis marks a point without a result.' : ''}${points.some(p => p.point.not_steady) ? ' A ring marks a point that is not steady.' : ''}${points.some(p => p.point.ordering) ? ' A square marks a point whose spheres are ordering.' : ''} Select a point to see its runs.`;
}
