/* The table of points, texts, controls, and updates from a server. */
let picked = null;
function table() {
  const is_shown = column => picked ? picked.has(column.name) : column.usual;
  const columns = data.columns.filter(is_shown), head = make('tr');
  head.append(make('th', { scope: 'col' }, 'runs of'), ...columns.map(column => make('th', { scope: 'col' }, column.heading)));
  $('points').replaceChildren(head, ...data.points.map((point, index) => {
    const row = make('tr'), cell = make('td'), button = make('button', { type: 'button', 'data-index': index, 'aria-pressed': index === chosen, 'aria-label': 'show the runs of ' + point.name }, 'show');
    button.onclick = () => choose(index);
    cell.append(button);
    row.append(cell, ...columns.map(column => make('td', {}, column.cells[index] ?? '–')));
    return row;
  }));
  if ($('columns').childElementCount !== data.columns.length) $('columns').replaceChildren(...data.columns.map(column => {
    const label = make('label', column.meaning ? { title: column.meaning } : {}), box = make('input', { type: 'checkbox', 'data-column': column.name });
    box.checked = is_shown(column);
    box.onchange = () => {
      picked ??= new Set(data.columns.filter(column => column.usual).map(column => column.name));
      box.checked ? picked.add(column.name) : picked.delete(column.name);
      table();
    };
    label.append(box, ' ' + column.heading);
    return label;
  }));
  cue();
}
/* Shows whether there are more columns to the right. */
function cue() {
  const box = $('points-box'), more = box.scrollWidth - box.clientWidth - box.scrollLeft > 2;
  box.classList.toggle('more', more);
  $('cue').hidden = box.scrollWidth - box.clientWidth <= 2;
}
function words() {
  document.title = `${data.campaign} · sweep`;
  for (const id of ['campaign', 'summary', 'text']) $(id).textContent = data[id];
  $('progress').value = data.work_done;
  options($('figure'), data.figures.map(figure => [figure.name, figure.label]));
  table();
  $('failures-section').hidden = !data.failures.length;
  $('failures').replaceChildren(...data.failures.map(line => make('li', {}, line)));
  const date = time => new Date(time).toISOString().slice(0, 16).replace('T', ' ');
  $('provenance').replaceChildren(...data.provenance.map(([program, started]) => make('li', {}, `${program}, started ${date(started)} UTC`)));
  $('save-points').href = 'data:text/csv;charset=utf-8,' + encodeURIComponent(data.csv);
  $('save-points').download = `${data.campaign}-points.csv`;
}
$('points-box').addEventListener('scroll', cue);
window.addEventListener('resize', cue);
for (const id of ['figure', 'along', 'where']) $(id).onchange = plot;
$('where').closest('label').hidden = !live;
$('play').onclick = () => timer ? stop() : play();
$('scrub').oninput = () => { stop(); at = +$('scrub').value; picture(); };
$('paint').onchange = picture;
dark.addEventListener('change', picture);
words(); plot();
/* On a wide screen the runs of a point are shown from the start, beside the figure. */
if (window.matchMedia('(min-width: 80rem)').matches) {
  const first = data.runs.find(run => data.movies[run.key]) ?? data.runs[0];
  if (first) { choose(first.point, true); if (data.movies[first.key]) watch(first); }
}

if (live) {
  const again = async () => {
    try {
      const answer = await fetch('data.json', { cache: 'no-store' });
      if (!answer.ok) throw new Error(String(answer.status));
      const before = data;
      data = await answer.json();
      /* Until something changes, the figures are those that are shown. */
      if (JSON.stringify(before) !== JSON.stringify(data)) {
        const focused = document.activeElement?.dataset?.index;
        if (before.points.map(point => point.name).join() !== data.points.map(point => point.name).join()) chosen = null;
        words(); plot();
        if (chosen !== null) choose(chosen, true);
        if (focused !== undefined) $('points').querySelector(`[data-index="${CSS.escape(focused)}"]`)?.focus();
      }
    } catch {
      $('summary').textContent = 'The server does not respond. This is the last state received.';
    }
    setTimeout(again, 3000);
  };
  setTimeout(again, 3000);
}
