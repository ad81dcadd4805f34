"""PDF files of tables, as other programs print them."""


def write_pdf(pages, path):
    """Write a PDF with words (x, y, text) on each page without a library; returns the path."""
    parts = ["<< /Type /Catalog /Pages 2 0 R >>", None]
    parts.append(
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>"
    )
    kids = []
    for words in pages:
        stream = "".join(f"BT /F 8 Tf 1 0 0 1 {x} {y} Tm ({t}) Tj ET\n" for x, y, t in words)
        parts.append(f"<< /Length {len(stream)} >>\nstream\n{stream}endstream")
        kids.append(len(parts) + 1)
        parts.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 595 842] /Contents {len(parts)} 0 R "
            "/Resources << /Font << /F 3 0 R >> >> >>"
        )
    listed = " ".join(f"{kid} 0 R" for kid in kids)
    parts[1] = f"<< /Type /Pages /Kids [{listed}] /Count {len(kids)} >>"
    data, places = "%PDF-1.4\n", []
    for number, part in enumerate(parts, 1):
        places.append(len(data))
        data += f"{number} 0 obj\n{part}\nendobj\n"
    rows = "".join(f"{place:010d} 00000 n \n" for place in places)
    data += f"xref\n0 {len(parts) + 1}\n0000000000 65535 f \n{rows}"
    data += f"trailer << /Size {len(parts) + 1} /Root 1 0 R >>\nstartxref\n"
    path.write_bytes((data + f"{data.index('xref')}\n%%EOF\n").encode("latin-1"))
    return path
