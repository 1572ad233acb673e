/* The table of points, and the texts. */

/* Columns by name: heading, cell. Axes that vary and main results come first. */
function columns() {
  const axes = varying(), c = data.cases;
  const of_axis = a => [a, heading_of(a), p => value_of(a, on(p, a))];
  const of_quantity = q => [q, QUANTITIES[q], p => with_half(p[q], p[q + '_ci95'] ?? null)];
  const first = (axes.length ? axes : [fraction(), 'shear_rate']).map(of_axis);
  const counts = ['seeds', 'jammed', 'failed', 'doubtful'].map(k => [k, k === 'seeds' ? 'runs' : k, p => p[k]]);
  const trend = ['trend', 'trend', trend_of];
  const rest = Object.keys(QUANTITIES).filter(q => q !== 'viscosity').map(of_quantity);
  const others = AXES.filter(a => !first.some(f => f[0] === a)).map(of_axis);
  const usual = new Set([...first.map(f => f[0]), 'viscosity', 'seeds', ...(c.jammed ? ['jammed'] : []), ...(c.failed ? ['failed'] : []), ...(data.doubtful ? ['doubtful'] : []), ...(data.points.some(trend_of) ? ['trend'] : []), 'viscosity_median', 'normal_stress_difference', 'contacts_per_sphere']);
  return { all: [...first, of_quantity('viscosity'), trend, ...counts, ...rest, ...others], usual };
}
let picked = null;
function table() {
  const { all, usual } = columns();
  const is_shown = ([key]) => (picked ?? usual).has(key);
  const shown = all.filter(is_shown);
  const head = make('tr');
  for (const [, name] of shown) head.append(make('th', { scope: 'col' }, name));
  $('points').replaceChildren(head, ...data.points.map((p, index) => {
    const row = make('tr', { class: index === chosen ? 'chosen' : '' });
    for (const [, , cell] of shown) row.append(make('td', {}, cell(p)));
    return row;
  }));
  if ($('columns').childElementCount !== all.length) $('columns').replaceChildren(...all.map(([key, name]) => {
    const label = make('label'), box = make('input', { type: 'checkbox', 'data-column': key });
    box.checked = is_shown([key]);
    box.onchange = () => {
      picked ??= new Set(usual);
      box.checked ? picked.add(key) : picked.delete(key);
      table();
    };
    label.append(box, ' ' + name);
    return label;
  }));
  cue();
}
/* The data of a drawing as a table, for screen readers; built when opened. */
function numbers(id, { head, rows }) {
  const box = $(id), row = (cells, tag) => { const line = make('tr'); line.append(...cells.map(v => make(tag, tag === 'th' ? { scope: 'col' } : {}, show(v)))); return line; };
  const fill = () => {
    const table = make('table');
    if (box.open) table.append(row(head, 'th'), ...rows.map(cells => row(cells, 'td')));
    box.lastElementChild.replaceChildren(table);
  };
  box.hidden = !rows.length;
  box.ontoggle = fill;
  fill();
}
/* Shows whether there are more columns to the right. */
function cue() {
  const box = $('points-box'), more = box.scrollWidth - box.clientWidth - box.scrollLeft > 2;
  box.classList.toggle('more', more);
  $('cue').hidden = box.scrollWidth - box.clientWidth <= 2;
}

function words() {
  const c = data.cases, total = c.done + c.jammed + c.failed + c.running + c.pending;
  document.title = `${data.campaign} · sweep`;
  $('name').textContent = data.campaign;
  const eta = data.eta_s !== null && data.eta_s !== undefined ? `, about ${data.eta_s < 90 ? Math.round(data.eta_s) + ' s' : data.eta_s < 5400 ? Math.round(data.eta_s / 60) + ' min' : (data.eta_s / 3600).toFixed(1) + ' h'} left` : '';
  $('summary').textContent = `${c.done} of ${total} runs done, ${c.jammed} jammed, ${c.failed} failed, ${c.running} running, ${c.pending} pending${eta}. Discarded strain: ${data.discard}.${data.selection ? ` Only where ${data.selection}.` : ''}${data.doubtful ? ` ${data.doubtful} finished runs are doubtful: ${data.with_doubtful ? 'included in' : 'excluded from'} all means.` : ''}`;
  $('progress').value = data.work_done;
  table();
  $('failures-section').hidden = !data.failures.length;
  $('failures').replaceChildren(...data.failures.map(f => make('li', {}, `${f.key.slice(0, 10)}, seed ${f.seed}, strain ${f.strain.toFixed(3)}: ${f.error}`)));
  $('provenance').replaceChildren(...data.provenance.map(p => make('li', {}, `sweep ${p.version}, physics ${p.physics_version}, build ${p.build.slice(0, 12)} on ${p.host}, ${p.threads} threads, ${p.results} results, started ${new Date(p.started_at).toISOString().slice(0, 16).replace('T', ' ')} UTC`)));
  $('text').textContent = data.text;
}
$('points-box').addEventListener('scroll', cue);
window.addEventListener('resize', cue);
