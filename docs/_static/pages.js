/* A picture leads to its file: there it has its own size, and fingers can spread it. */
for (const image of document.querySelectorAll(".bd-article img:not(a img)")) {
  if (image.closest(".sd-card, .only-light, .only-dark")) continue;
  const link = document.createElement("a");
  link.href = image.src;
  link.className = "picture";
  image.replaceWith(link);
  link.append(image);
}
