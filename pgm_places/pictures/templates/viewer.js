// Open a map large, zoom, and flip between methods in place.
(() => {
  const dialog = document.querySelector('dialog');
  if (!dialog || !dialog.showModal) return;
  const bar = dialog.querySelector('.bar');
  const stage = dialog.querySelector('.stage');
  const picture = stage.querySelector('img');
  const choice = bar.querySelector('select');
  const buttons = [...document.querySelectorAll('.map button')];
  let layers = [];
  let width = 1;

  // The width on screen stays while layers change, so that differences jump to the eye.
  const resize = (wanted) => {
    width = Math.min(24000, Math.max(50, wanted));
    picture.style.width = width + 'px';
  };
  const fit = () => {
    const aspect = picture.naturalWidth / picture.naturalHeight;
    resize(Math.min(stage.clientWidth, stage.clientHeight * aspect));
  };
  const zoom = (factor) => {
    const x = (stage.scrollLeft + stage.clientWidth / 2) / stage.scrollWidth;
    const y = (stage.scrollTop + stage.clientHeight / 2) / stage.scrollHeight;
    resize(width * factor);
    stage.scrollTo(
      x * stage.scrollWidth - stage.clientWidth / 2,
      y * stage.scrollHeight - stage.clientHeight / 2,
    );
  };
  const show = (index) => {
    const current = (index + layers.length) % layers.length;
    const source = layers[current].querySelector('img');
    choice.selectedIndex = current;
    picture.src = source.src;
    picture.alt = source.alt;
  };
  const step = (by) => show(choice.selectedIndex + by);
  const open = (button) => {
    layers = buttons.filter((other) => other.dataset.map === button.dataset.map);
    choice.replaceChildren(...layers.map((layer) => new Option(layer.dataset.layer)));
    show(layers.indexOf(button));
    dialog.showModal();
    choice.focus();
    picture.decode().then(fit, fit);
  };

  const actions = {
    next: () => step(1),
    previous: () => step(-1),
    larger: () => zoom(2),
    smaller: () => zoom(0.5),
    fit: fit,
    close: () => dialog.close(),
  };
  const keys = {
    ArrowRight: 'next', ArrowLeft: 'previous', '+': 'larger', '-': 'smaller', 0: 'fit',
  };
  bar.querySelectorAll('button').forEach((button) => {
    button.addEventListener('click', actions[button.dataset.action]);
  });
  choice.addEventListener('change', () => show(choice.selectedIndex));
  dialog.addEventListener('keydown', (event) => {
    const action = keys[event.key];
    if (!action || event.ctrlKey || event.metaKey) return;
    actions[action]();
    event.preventDefault();
  });
  buttons.forEach((button) => button.addEventListener('click', () => open(button)));
  window.addEventListener('beforeprint', () => {
    document.querySelectorAll('details').forEach((part) => { part.open = true; });
  });
})();
