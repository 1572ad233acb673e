/* Controls, and updates from a server. */
const VIEWS = { curve: plot_curves, flow: plot_curves, contacts: plot_curves, histogram: plot_histogram, map: plot_map, versus: plot_versus };
/* The views that have each control. */
const HAS = { quantity: ['curve', 'map'], along: ['curve', 'contacts'], log: ['curve', 'flow', 'contacts'], bands: ['curve', 'flow'], 'map-x': ['map'], 'map-y': ['map'], 'run-a': ['versus'], 'run-b': ['versus'] };

function plot() {
  const view = $('view').value, focused = document.activeElement?.dataset?.index;
  for (const [id, views] of Object.entries(HAS)) $(id).closest('label').hidden = !views.includes(view);
  $('filters').hidden = view === 'versus';
  $('tip').hidden = true;
  $('remark').textContent = '';
  $('note').textContent = '';
  shown_table = { head: [], rows: [] };
  VIEWS[view](view);
  numbers('plot-numbers', shown_table);
  if (focused !== undefined) $('plot').querySelector(`[data-index="${CSS.escape(focused)}"]`)?.focus();
}
function controls() {
  const keep = (select, options, preferred) => {
    const before = select.value;
    select.replaceChildren(...options.map(([value, name]) => make('option', { value }, name)));
    select.value = options.some(o => o[0] === before) ? before : options.some(o => o[0] === preferred) ? preferred : options[0]?.[0];
  };
  keep($('quantity'), Object.entries(QUANTITIES), 'viscosity');
  const axes = varying(), numeric = axes.filter(a => AXIS[a].numeric), name = a => [a, AXIS[a].symbol];
  /* The imposed rate or stress, if it varies. */
  const shear = ['shear_rate', 'shear_stress'].find(a => axes.includes(a));
  keep($('along'), (numeric.length ? numeric : ['shear_rate']).map(name), shear);
  keep($('map-x'), axes.map(name), shear ?? axes[0]);
  keep($('map-y'), axes.map(name), axes.find(a => a !== $('map-x').value));
  const runs = data.runs.map(run => [run.key, run_name(run)]);
  keep($('run-a'), runs, runs[0]?.[0]);
  keep($('run-b'), runs, runs[1]?.[0]);
  filters();
}
function filters() {
  const view = $('view').value, used = view === 'map' ? [$('map-x').value, $('map-y').value] : view === 'histogram' ? [] : [along_of(view)];
  $('filters').replaceChildren(...varying().filter(a => !used.includes(a)).map(axis => {
    const label = make('label', {}, heading_of(axis) + ' '), select = make('select', { 'data-axis': axis });
    select.append(make('option', { value: '' }, 'all'), ...values(axis).map(v => make('option', { value: String(v) }, value_of(axis, v))));
    select.value = chosenFilters[axis] ?? '';
    select.onchange = () => { chosenFilters[axis] = select.value; plot(); };
    label.append(select);
    return label;
  }));
}
/* An axis that is plotted has no filter. */
const reset = () => { for (const key in chosenFilters) delete chosenFilters[key]; filters(); plot(); };
for (const id of ['quantity', 'log', 'bands', 'run-a', 'run-b']) $(id).onchange = plot;
for (const id of ['view', 'along', 'map-x', 'map-y']) $(id).onchange = reset;
const redraw = () => { plot(); if (chosen !== null) choose(chosen, true); picture(); cue(); };
window.matchMedia('(max-width: 40rem)').addEventListener('change', redraw);
dark.addEventListener('change', redraw);
const spread = data.points.map(p => p.viscosity).filter(v => v > 0);
$('log').checked = spread.length > 1 && Math.max(...spread) > 10 * Math.min(...spread);
words(); controls(); plot();
/* On a wide screen the runs of a point are shown from the start, beside the curves. */
if (window.matchMedia('(min-width: 80rem)').matches) {
  const first = data.runs.find(run => data.movies[run.key]) ?? data.runs.find(run => run.trace.length > 1);
  if (first) { choose(first.point, true); if (data.movies[first.key]) watch(first); plot(); }
}

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
      $('summary').textContent = 'The server does not respond. This is the last state received.';
    }
    setTimeout(again, 3000);
  };
  setTimeout(again, 3000);
}
