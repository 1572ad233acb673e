/* The runs of a point: traces and movies. */
function choose(index, quietly) {
  chosen = index;
  const point = data.points[index];
  $('runs').hidden = false;
  $('point').textContent = point.name;
  show('trace', point.trace, 'runs.svg?point=' + index, 'viscosity against strain, ' + point.name);
  const runs = data.runs.filter(run => run.point === index), table = make('table'), head = make('tr');
  for (const name of ['seed', data.viscosity_label, 'state', 'movie', 'time / s', 'key']) head.append(make('th', { scope: 'col' }, name));
  table.append(head);
  for (const run of runs) {
    const row = make('tr'), cell = make('td');
    if (data.movies[run.key]) {
      const button = make('button', { type: 'button', 'aria-label': `play the movie of seed ${run.seed}` }, 'play');
      button.onclick = async () => { if (await watch(run)) play(); $('movie').scrollIntoView({ block: 'nearest' }); };
      cell.append(button);
    } else cell.textContent = '–';
    row.append(make('td', {}, run.seed), make('td', {}, run.viscosity), make('td', {}, run.state), cell, make('td', {}, run.time), make('td', { class: 'name' }, run.key.slice(0, 10)));
    table.append(row);
  }
  $('run-list').replaceChildren(table);
  for (const button of document.querySelectorAll('#points button')) button.setAttribute('aria-pressed', button.dataset.index === String(index));
  /* Beside the runs the table is narrower. */
  cue();
  if (quietly) return;
  const first = runs.find(run => data.movies[run.key]);
  if (first) watch(first); else { stop(); movie = asked = null; $('movie').hidden = true; }
  $('runs').scrollIntoView({ block: 'nearest' });
}

/* The movie of a run. */
let movie = null, at = 0, timer = null, asked = null;
function stop() { clearInterval(timer); timer = null; $('play').textContent = 'Play'; $('play').setAttribute('aria-pressed', 'false'); }
function play() {
  $('play').textContent = 'Pause'; $('play').setAttribute('aria-pressed', 'true');
  timer = setInterval(() => { at = (at + 1) % movie.frames.length; picture(); }, 80);
}
/* Shows the first frame of a movie; whether it is there and still wanted. */
async function watch(run) {
  stop();
  asked = run.key;
  let film = data.movies[run.key];
  if (film === true) {
    const answer = await fetch('movie/' + encodeURIComponent(run.key)).catch(() => null);
    if (!answer?.ok) return false;
    film = await answer.json();
    /* Another movie was requested in the meantime. */
    if (asked !== run.key) return false;
  }
  movie = film; at = 0;
  $('movie').hidden = false;
  $('movie-name').textContent = `Movie of the run with seed ${run.seed}`;
  $('scrub').max = movie.frames.length - 1;
  picture();
  return true;
}
/* The quantity that spheres are coloured by, for each sphere. */
function measure(kind, n, radius) {
  const f = movie.frames[at], numbers = new Float64Array(n);
  if (kind === 'spin') {
    /* Rotation per strain from this frame to the next, at the last frame from the one before. */
    const [a, b] = at + 1 < movie.frames.length ? [f, movie.frames[at + 1]] : [movie.frames[at - 1] ?? f, f], time = b.strain - a.strain || 1;
    /* In a suspension the angle is known only up to full turns. */
    const turned = angle => f.z ? angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI)) : angle;
    for (let i = 0; i < n; i++) numbers[i] = turned(b.x[3 * i + 2] - a.x[3 * i + 2]) / time;
  } else for (const [i, j, , , , force] of f.contacts) {
    numbers[i] += kind === 'contacts' ? 1 : force / (4 * Math.PI * radius(i) ** 2);
    numbers[j] += kind === 'contacts' ? 1 : force / (4 * Math.PI * radius(j) ** 2);
  }
  return numbers;
}
const MEASURES = { pressure: 'contact forces over the surface of a sphere, in μ × shear rate', contacts: 'contacts per sphere', spin: 'rotation per strain' };
/* The limits of the colour scale: the same for all frames, so that they can be compared. */
function ends_of(kind, n, radius) {
  movie.ends ??= {};
  if (!movie.ends[kind]) {
    const now = at, all = [];
    for (at = 0; at < movie.frames.length; at += Math.max(1, Math.floor(movie.frames.length / 12))) all.push(...measure(kind, n, radius));
    at = now;
    all.sort((a, b) => a - b);
    const low = kind === 'spin' ? all[Math.floor(.03 * all.length)] : 0, high = all[Math.min(all.length - 1, Math.floor(.98 * all.length))];
    movie.ends[kind] = [low, Math.max(high, low + (kind === 'contacts' ? 1 : 1e-3))];
  }
  return movie.ends[kind];
}
function picture() {
  if (!movie) return;
  const canvas = $('layer'), pen = canvas.getContext('2d'), f = movie.frames[at], side = movie.side;
  const scale = canvas.width / side;
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.setTransform(scale, 0, 0, -scale, 0, canvas.height);
  const n = f.x.length / 3, radius = i => movie.radii[movie.radii.length === 1 ? 0 : i];
  /* Of a lattice that is no sheared cell, a square, or a cube, as large as the cell is cut out. */
  const [a, b, c] = f.lattice ?? [], depths = c ? 4 : 0;
  const cut = (i, reach, paint) => {
    for (let l = -depths; l <= depths; l++) for (let m = -4; m <= 4; m++) for (let k = -4; k <= 4; k++) {
      const pz = c ? f.z[i] + m * a[2] + k * b[2] + l * c[2] : 0;
      if (pz < 0 || pz >= side) continue;
      const px = f.x[3 * i] + m * a[0] + k * b[0] + (c ? l * c[0] : 0), py = f.x[3 * i + 1] + m * a[1] + k * b[1] + (c ? l * c[1] : 0);
      if (px > -reach && px < side + reach && py > -reach && py < side + reach) paint(px, py, pz);
    }
  };
  const wrap = (x, y) => { const rows = Math.floor(y / side); x -= rows * f.offset; y -= rows * side; return [x - Math.floor(x / side) * side, y]; };
  const images = (i, reach, paint) => {
    if (a) return cut(i, reach, paint);
    const [x, y] = wrap(f.x[3 * i], f.x[3 * i + 1]), z = f.z ? f.z[i] : 0;
    for (let row = -1; row <= 1; row++) for (let column = -2; column <= 2; column++) {
      const px = x + column * side + row * f.offset, py = y + row * side;
      if (px > -reach && px < side + reach && py > -reach && py < side + reach) paint(px, py, z);
    }
  };
  const kind = $('paint').value, numbers = kind ? measure(kind, n, radius) : null, [low, high] = kind ? ends_of(kind, n, radius) : [0, 1];
  $('meaning').textContent = kind ? `${MEASURES[kind]}: ${+low.toPrecision(2)} (dark) to ${+high.toPrecision(2)} (light)` : '';
  const paper = ink('--paper'), soft = ink('--soft');
  pen.lineWidth = .06;
  /* A suspension is viewed along the vorticity: the nearest spheres are drawn last. */
  const order = [];
  for (let i = 0; i < n; i++) images(i, radius(i), (px, py, pz) => order.push([i, px, py, pz]));
  order.sort((one, other) => one[3] - other[3]);
  for (const [i, px, py] of order) {
    const angle = f.x[3 * i + 2], r = radius(i), part = kind ? (numbers[i] - low) / (high - low) : 0;
    pen.beginPath(); pen.arc(px, py, r, 0, 7); pen.fillStyle = kind ? heat(part) : paper; pen.fill(); pen.strokeStyle = soft; pen.stroke();
    pen.strokeStyle = kind ? (part > .55 ? '#111' : '#fff') : soft;
    pen.beginPath(); pen.moveTo(px + .35 * r * Math.cos(angle), py + .35 * r * Math.sin(angle)); pen.lineTo(px + .85 * r * Math.cos(angle), py + .85 * r * Math.sin(angle)); pen.stroke();
  }
  const colours = [soft, ink('--rolling'), ink('--slipping')];
  pen.lineCap = 'round';
  for (const [i, j, state, nx, ny, force] of f.contacts) {
    const r = radius(i) + radius(j);
    pen.strokeStyle = colours[state]; pen.lineWidth = Math.min(.06 + .34 * force / movie.force, .55);
    images(i, 2 * r, (px, py) => { pen.beginPath(); pen.moveTo(px, py); pen.lineTo(px + r * nx, py + r * ny); pen.stroke(); });
  }
  $('scrub').value = at;
  $('scrub').setAttribute('aria-valuetext', `strain ${f.strain.toFixed(2)}`);
  const of_state = number => f.contacts.filter(contact => contact[2] === number).length;
  canvas.setAttribute('aria-label', `the ${f.z ? 'suspension, viewed along the vorticity,' : 'layer'} at a strain of ${f.strain.toFixed(2)}: ${n} spheres and ${f.contacts.length} contacts, of which ${of_state(0)} frictionless, ${of_state(1)} rolling, ${of_state(2)} slipping`);
  $('strain').textContent = `${f.strain.toFixed(2)}, ${f.contacts.length} contacts`;
}
