"""The studio: labels of a map corrected and learned in the browser, on this computer only."""
