document.documentElement.classList.add('js');
addEventListener('DOMContentLoaded', () => {
  const table = document.querySelector('.main');
  const items = [...table.tBodies];
  const words = document.getElementById('words');
  const program = document.getElementById('program');
  const status = document.getElementById('status');
  const shown = document.querySelector('.shown');
  const none = document.querySelector('.none');

  const filter = () => {
    const wanted = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const item of items) {
      const visible = wanted.every(word => item.dataset.words.includes(word)) &&
        (!program.value || item.dataset.program === program.value) &&
        (!status.value || item.dataset.status === status.value);
      item.hidden = !visible;
      count += visible;
    }
    shown.textContent = `${count} of ${items.length} shown`;
    none.hidden = count > 0;
  };
  for (const control of [words, program, status]) control.addEventListener('input', filter);
  filter();

  const headers = [...table.tHead.rows[0].cells];
  const value = (item, column) => item.rows[0].cells[column].dataset.v ?? '';
  headers.forEach((header, column) => header.addEventListener('click', () => {
    const direction = header.dataset.dir === '1' ? -1 : 1;
    headers.forEach(other => delete other.dataset.dir);
    header.dataset.dir = direction;
    const text = header.classList.contains('t');
    items.sort((a, b) => {
      const x = value(a, column), y = value(b, column);
      if (text) return direction * x.localeCompare(y, undefined, {numeric: true});
      if (x === '' || y === '') return (x === '') - (y === '');  // figures that are missing go last
      return direction * (Number(x) - Number(y));
    });
    table.append(...items);
  }));

  const open = (item, wanted) => item.classList.toggle('open', wanted);
  table.addEventListener('click', event => {
    const row = event.target.closest('tr.row');
    if (row) open(row.parentNode);
  });
  const follow = () => {
    const item = location.hash && document.getElementById(location.hash.slice(1));
    if (item && items.includes(item)) { open(item, true); item.scrollIntoView(); }
  };
  addEventListener('hashchange', follow);
  follow();

  const zoom = document.querySelector('dialog');
  table.addEventListener('click', event => {
    const frame = event.target.closest('.frame');
    if (!frame) return;
    zoom.firstElementChild.src = frame.querySelector('img').src;
    zoom.showModal();
  });
  zoom.addEventListener('click', () => zoom.close());
});
